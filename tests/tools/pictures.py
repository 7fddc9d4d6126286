"""Our own picture of a clip, and how alike two pictures are."""

import cv2
import numpy as np
import torch

from animator.render.cpu import CpuRenderer
from animator.types import Camera, Gaussians
from exporters.clip import Clip


def own_picture(clip: Clip, time_s: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Draw the Gaussians on white through the clip's first camera.

    Args:
        clip: A clip with a camera.
        time_s: The moment [s]; None for the rest pose.

    Returns:
        RGB 0..1, shape (H, W, 3), and coverage 0..1, shape (H, W).
    """
    splats, filmed = clip.splats, clip.camera
    posed = splats if time_s is None else clip.pose_at(time_s)
    fields = (posed.positions, posed.quats_wxyz, splats.scales, splats.opacities, splats.sh_coeffs)
    means, quats_wxyz, scales, opacities, sh_coeffs = (torch.tensor(field) for field in fields)
    gaussians = Gaussians(
        means=means,
        quats_wxyz=quats_wxyz,
        scales=scales,
        opacities=opacities,
        sh_coeffs=sh_coeffs,
    )
    camera = Camera(
        cam_from_world=filmed.cam_from_world[0],
        intrinsics=filmed.intrinsics,
        width_px=filmed.width_px,
        height_px=filmed.height_px,
    )
    rendering = CpuRenderer().render(gaussians, camera, background=(1.0, 1.0, 1.0))
    return rendering.rgb.clamp(0.0, 1.0).numpy(), rendering.alpha.numpy()


def read_picture(path: object) -> np.ndarray:
    """Read a PNG as RGB 0..1, shape (H, W, 3)."""
    return cv2.imread(str(path))[:, :, ::-1] / 255.0


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    """Return the peak signal-to-noise ratio of two pictures [dB]."""
    return float(-10.0 * np.log10(np.mean((one - other) ** 2)))


def silhouette_iou(picture: np.ndarray, coverage: np.ndarray) -> float:
    """Compare what is not white in a picture with what the Gaussians cover by half."""
    drawn = np.abs(picture - 1.0).max(axis=2) > 0.02
    covered = coverage > 0.5
    return float((drawn & covered).sum() / (drawn | covered).sum())
