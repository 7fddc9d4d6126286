"""Small torch-side objects with known motion."""

import numpy as np
import torch

from animator.types import Camera, Gaussians


def gaussians_at(points: np.ndarray, *, opacity: float = 0.9, scale: float = 0.02) -> Gaussians:
    """Return isotropic gray Gaussians at the given points."""
    count = len(points)
    quats = torch.zeros(count, 4)
    quats[:, 0] = 1.0
    return Gaussians(
        means=torch.as_tensor(points, dtype=torch.float32),
        quats_wxyz=quats,
        scales=torch.full((count, 3), scale),
        opacities=torch.full((count,), opacity),
        sh_coeffs=torch.zeros(count, 1, 3),
    )


def box_points(
    center: tuple[float, float, float], size: tuple[float, float, float], count: int, seed: int
) -> np.ndarray:
    """Return points uniform in a box."""
    rng = np.random.default_rng(seed)
    return np.asarray(center) + (rng.random((count, 3)) - 0.5) * np.asarray(size)


def front_camera(distance: float = 4.0, *, size_px: int = 200) -> Camera:
    """Return a camera on the -z side looking along +z."""
    cam_from_world = np.eye(4)
    cam_from_world[2, 3] = distance
    focal = 1.3 * size_px
    intrinsics = np.array([[focal, 0, size_px / 2], [0, focal, size_px / 2], [0, 0, 1.0]])
    return Camera(
        cam_from_world=cam_from_world, intrinsics=intrinsics, width_px=size_px, height_px=size_px
    )
