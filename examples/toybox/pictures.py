"""Light the splats and photograph them with the project's own renderer."""

import dataclasses

import numpy as np
import torch

from animator import quaternions
from animator.render.protocol import Renderer
from animator.types import Camera, Gaussians
from toybox.splats import SurfaceSplats

OPACITY = 0.99

_SH_C0 = 0.28209479177387814  # Y_0^0
_TO_LIGHT = np.array([0.45, 0.75, 0.48])
_AMBIENT, _DIFFUSE = 0.72, 0.34


def lit_gaussians(splats: SurfaceSplats) -> Gaussians:
    """Light the splats where they are: the lamp turns, the light does not turn with it."""
    brightness = _AMBIENT + _DIFFUSE * np.clip(splats.normals @ _TO_LIGHT, 0.0, 1.0)
    brightness = splats.glows + (1.0 - splats.glows) * brightness
    colors = np.clip(splats.albedos * brightness[:, None], 0.0, 1.0)
    axes = torch.from_numpy(splats.axes)
    return Gaussians(
        means=_tensor(splats.positions),
        quats_wxyz=quaternions.normalize(quaternions.from_matrices(axes)).float(),
        scales=_tensor(splats.scales),
        opacities=torch.full((len(splats),), OPACITY),
        sh_coeffs=_tensor((colors - 0.5) / _SH_C0)[:, None],
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Shot:
    """Where a picture is taken from."""

    azimuth_deg: float
    """0 looks along -z at the front, 90 from +x."""
    elevation_deg: float
    distance: float
    """From the target [scene unit]."""
    target: tuple[float, float, float]
    """What is in the middle of the picture."""
    field_of_view_deg: float
    size_px: int

    @property
    def world_from_opengl(self) -> np.ndarray:
        """Camera to world with OpenGL axes (+x right, +y up, -z forward), shape (4, 4)."""
        azimuth, elevation = np.radians([self.azimuth_deg, self.elevation_deg])
        back = np.array(
            [
                np.sin(azimuth) * np.cos(elevation),
                np.sin(elevation),
                np.cos(azimuth) * np.cos(elevation),
            ]
        )
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        pose = np.eye(4)
        pose[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
        pose[:3, 3] = np.array(self.target) + self.distance * back
        return pose

    @property
    def focal_px(self) -> float:
        """Focal length [px]."""
        return 0.5 * self.size_px / float(np.tan(np.radians(self.field_of_view_deg) / 2))

    @property
    def camera(self) -> Camera:
        """The camera with OpenCV axes."""
        world_from_cam = self.world_from_opengl @ np.diag([1.0, -1.0, -1.0, 1.0])
        middle = self.size_px / 2
        return Camera(
            cam_from_world=np.linalg.inv(world_from_cam),
            intrinsics=np.array(
                [[self.focal_px, 0.0, middle], [0.0, self.focal_px, middle], [0.0, 0.0, 1.0]]
            ),
            width_px=self.size_px,
            height_px=self.size_px,
        )


def photograph(splats: SurfaceSplats, shot: Shot, renderer: Renderer) -> np.ndarray:
    """Take a picture: RGBA, straight alpha, sRGB, uint8, shape (H, W, 4)."""
    with torch.no_grad():
        picture = renderer.render(lit_gaussians(splats), shot.camera)
    alpha = picture.alpha.cpu().numpy()
    premultiplied = picture.rgb.cpu().numpy()
    straight = premultiplied / np.maximum(alpha, 1 / 255)[:, :, None]
    rgba = np.concatenate([straight, alpha[:, :, None]], axis=2)
    rgba[alpha < 0.5 / 255] = 0.0  # empty pixels compress better when their color is the same
    return np.round(255 * np.clip(rgba, 0.0, 1.0)).astype(np.uint8)


def _tensor(values: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))
