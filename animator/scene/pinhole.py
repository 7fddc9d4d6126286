"""The pinhole lens and rigid pose that all camera formats are reduced to."""

import dataclasses
import logging

import numpy as np

from animator.errors import InputError
from animator.types import Camera

logger = logging.getLogger(__name__)

_MAX_SIDE_PX = 1 << 17
_ASPECT_TOLERANCE = 0.01
"""Relative; rounding 1080 / 1920 down to thumbnails of 100 px stays inside."""
_ROTATION_TOLERANCE = 1e-3
"""Relative spread of the singular values; text files with four digits stay inside."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Lens:
    """Intrinsics without distortion; (0, 0) is the outer corner of the top-left pixel."""

    fx_px: float
    """Focal length along x [px]."""
    fy_px: float
    """Focal length along y [px]."""
    cx_px: float
    """Principal point, x [px]."""
    cy_px: float
    """Principal point, y [px]."""
    width_px: int
    """Image width [px]."""
    height_px: int
    """Image height [px]."""

    def camera(self, cam_from_world: np.ndarray, *, name: str, where: str) -> Camera:
        """Place the lens in the world.

        Args:
            cam_from_world: World to camera, OpenCV axes, shape (4, 4).
            name: Name of the image.
            where: File and position, for messages.

        Raises:
            InputError: If the image has no plausible size, a focal length is not positive, or the
            principal point is not finite.
        """
        for field, side_px in (("width", self.width_px), ("height", self.height_px)):
            if not 1 <= side_px <= _MAX_SIDE_PX:
                raise InputError(
                    f"{where}: image {field}: expected 1..{_MAX_SIDE_PX} pixels, found {side_px}."
                )
        for field, focal_px in (("x", self.fx_px), ("y", self.fy_px)):
            if not (np.isfinite(focal_px) and focal_px > 0):
                raise InputError(
                    f"{where}: focal length {field}: expected a positive number of pixels, "
                    f"found {focal_px:g}."
                )
        if not (np.isfinite(self.cx_px) and np.isfinite(self.cy_px)):
            raise InputError(
                f"{where}: principal point: expected finite numbers, found "
                f"({self.cx_px}, {self.cy_px})."
            )
        intrinsics = np.array(
            [[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]]
        )
        return Camera(
            cam_from_world=cam_from_world,
            intrinsics=intrinsics,
            width_px=self.width_px,
            height_px=self.height_px,
            name=name,
        )


def rigid_transform(rotation: np.ndarray, translation: np.ndarray, *, where: str) -> np.ndarray:
    """Assemble a rigid transformation and remove rounding (and a uniform scale) from its rotation.

    Args:
        rotation: Rotation, possibly rounded or uniformly scaled, shape (3, 3).
        translation: Translation [scene unit], shape (3,).
        where: File and position, for messages.

    Returns:
        Rigid transformation, float64, shape (4, 4).

    Raises:
        InputError: If the matrix shears, stretches or mirrors, or a number is not finite.
    """
    if not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
        raise InputError(f"{where}: expected a pose of finite numbers, found NaN or Inf.")
    u, singular, vt = np.linalg.svd(rotation)
    is_stretched = singular[0] - singular[2] > _ROTATION_TOLERANCE * singular[0]
    if is_stretched or singular[2] <= 0 or np.linalg.det(rotation) <= 0:
        raise InputError(
            f"{where}: expected a rotation in the upper left 3x3 block, found determinant "
            f"{np.linalg.det(rotation):.4g} and axis lengths {singular[2]:.4g} to "
            f"{singular[0]:.4g}; is the matrix mirrored, or stored in another order?"
        )
    transform = np.eye(4)
    transform[:3, :3] = u @ vt
    transform[:3, 3] = translation
    return transform


def rigid_inverse(transform: np.ndarray) -> np.ndarray:
    """Invert a rigid transformation, shape (4, 4)."""
    inverse = np.eye(4)
    inverse[:3, :3] = transform[:3, :3].T
    inverse[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return inverse


def scale_camera(camera: Camera, width_px: int, height_px: int) -> Camera:
    """Return the same view at another image size.

    Pixel positions count from the outer corner of the image, so both axes scale without an offset.
    """
    scale_x, scale_y = width_px / camera.width_px, height_px / camera.height_px
    return dataclasses.replace(
        camera,
        intrinsics=np.diag([scale_x, scale_y, 1.0]) @ camera.intrinsics,
        width_px=width_px,
        height_px=height_px,
    )


def fit_cameras(
    cameras: tuple[Camera, ...], width_px: int, height_px: int, *, where: str
) -> tuple[Camera, ...]:
    """Make cameras fit images of the given size, with one warning if they had another.

    Raises:
        InputError: If a camera's image has another aspect ratio.
    """
    others = [camera for camera in cameras if _size_px(camera) != (width_px, height_px)]
    for camera in others:
        aspect_ratio = (camera.width_px / camera.height_px) / (width_px / height_px)
        if abs(aspect_ratio - 1) > _ASPECT_TOLERANCE:
            raise InputError(
                f"{where}: the camera {camera.name!r} is for images of {camera.width_px}x"
                f"{camera.height_px} pixels, the frames have {width_px}x{height_px}, another "
                "aspect ratio; were the frames cropped or rotated? Give the camera of the frames "
                "as they are (--frame-camera), or frames of the camera's shape."
            )
    if others:
        logger.warning(
            "%s: scaled the intrinsics of %d camera(s) from %dx%d to the frames' %dx%d pixels.",
            where,
            len(others),
            *_size_px(others[0]),
            width_px,
            height_px,
        )
    return tuple(scale_camera(camera, width_px, height_px) for camera in cameras)


def _size_px(camera: Camera) -> tuple[int, int]:
    return camera.width_px, camera.height_px
