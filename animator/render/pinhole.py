"""Refusing cameras that no renderer here can draw."""

import numpy as np

from animator.errors import InputError
from animator.types import Camera


def check_pinhole(camera: Camera) -> None:
    """Check that a camera is a pinhole without skew and has at least one pixel.

    Raises:
        InputError: If it is not.
    """
    name = camera.name or "camera"
    focal_x, skew = camera.intrinsics[0, :2]
    focal_y = camera.intrinsics[1, 1]
    if camera.width_px < 1 or camera.height_px < 1:
        raise InputError(
            f"{name}: expected an image of at least 1 x 1 px, found "
            f"{camera.width_px} x {camera.height_px}; check the camera file's width and height"
        )
    if not (np.isfinite(camera.intrinsics).all() and np.isfinite(camera.cam_from_world).all()):
        raise InputError(
            f"{name}: expected finite intrinsics and pose, found a NaN or an infinity; check the "
            "camera file's numbers"
        )
    if focal_x <= 0 or focal_y <= 0:
        raise InputError(
            f"{name}: intrinsics: expected focal lengths above 0 px, found {focal_x:g} and "
            f"{focal_y:g}; check the camera file's convention (OpenCV axes, +z forward)"
        )
    if abs(skew) > 1e-6 * focal_x:
        raise InputError(
            f"{name}: intrinsics[0, 1]: expected no skew, found {skew:g}; undistort the images to "
            "perpendicular axes first"
        )
