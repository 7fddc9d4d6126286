"""Small scenes that are hard in one way each."""

import math

import numpy as np
import torch

from animator.types import Camera, Gaussians

FIELDS = ("means", "quats_wxyz", "scales", "opacities", "sh_coeffs")


def gaussians(seed: int, count: int, *, degree: int = 0) -> Gaussians:
    """A cloud of overlapping Gaussians around the origin, about one unit wide."""
    rng = np.random.default_rng(seed)

    def tensor(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.asarray(values, np.float32))

    return Gaussians(
        means=tensor(rng.normal(0, 0.5, (count, 3))),
        quats_wxyz=tensor(rng.normal(size=(count, 4))),
        scales=tensor(np.exp(rng.normal(-2.3, 0.6, (count, 3)))),
        opacities=tensor(rng.uniform(0.02, 0.98, count)),
        sh_coeffs=tensor(rng.normal(0, 0.4, (count, (degree + 1) ** 2, 3))),
    )


def camera(width_px: int, height_px: int, *, distance: float = 3.0, zoom: float = 1.0) -> Camera:
    """A camera with no symmetry at all: turned, off-centre, with pixels that are not square."""
    yaw, pitch = 0.4, -0.3
    turn = np.array(
        [[math.cos(yaw), 0, math.sin(yaw)], [0, 1, 0], [-math.sin(yaw), 0, math.cos(yaw)]]
    )
    tilt = np.array(
        [[1, 0, 0], [0, math.cos(pitch), -math.sin(pitch)], [0, math.sin(pitch), math.cos(pitch)]]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = tilt @ turn
    matrix[:3, 3] = (0.05, -0.1, distance)
    focal = zoom * max(width_px, height_px)
    intrinsics = np.array(
        [[focal, 0, 0.47 * width_px], [0, 0.85 * focal, 0.56 * height_px], [0, 0, 1.0]]
    )
    return Camera(
        cam_from_world=matrix, intrinsics=intrinsics, width_px=width_px, height_px=height_px
    )
