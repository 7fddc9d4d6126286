"""A textured box of Gaussians that a renderer can draw and a matcher can follow."""

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from animator.types import Camera, Frames, Gaussians
from tests.helpers.objects import gaussians_at


def textured_box(count: int = 1500, *, seed: int = 0) -> Gaussians:
    """Return a box of 1.4 x 0.8 x 0.6 whose surface has soft colored blobs."""
    rng = np.random.default_rng(seed)
    half = np.array([0.7, 0.4, 0.3])
    points = rng.uniform(-1, 1, (count, 3))
    face = rng.integers(0, 3, count)
    points[np.arange(count), face] = np.sign(rng.uniform(-1, 1, count))
    points *= half
    waves = rng.normal(0, 6, (3, 3, 4))
    phases = rng.uniform(0, 6, (3, 4))
    colors = np.stack(
        [np.sin(points @ waves[c] + phases[c]).mean(axis=1) for c in range(3)], axis=1
    )
    gaussians = gaussians_at(points, opacity=0.95, scale=0.035)
    gaussians.sh_coeffs[:, 0] = torch.as_tensor(colors / 0.28209479, dtype=torch.float32)
    return gaussians


def filmed(renders: list[tuple[np.ndarray, np.ndarray]]) -> Frames:
    """Turn renders on black (color, alpha) into frames with straight alpha."""
    images, alphas = [], []
    for rgb, alpha in renders:
        straight = rgb / np.maximum(alpha, 1e-3)[..., None]
        images.append((straight * 255).round().clip(0, 255).astype(np.uint8))
        alphas.append((alpha * 255).round().astype(np.uint8))
    count = len(renders)
    return Frames(
        images=np.stack(images),
        alphas=np.stack(alphas),
        numbers=tuple(range(count)),
        names=tuple(f"{k:04d}.png" for k in range(count)),
        fps=24.0,
    )


def draw(renderer, gaussians: Gaussians, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Render on black as numpy color and alpha."""
    rendering = renderer.render(gaussians, camera)
    return rendering.rgb.numpy(), rendering.alpha.numpy()


def fold(points: torch.Tensor, angle_deg: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Turn what is right of the middle away from the camera; return where points get to, and their turns."""
    turn = Rotation.from_euler("y", [[0.0], [angle_deg]], degrees=True)
    right = (points[:, 0] > 0).long()
    matrices = torch.as_tensor(turn.as_matrix(), dtype=torch.float32)[right]
    quats_wxyz = torch.as_tensor(turn.as_quat(scalar_first=True), dtype=torch.float32)[right]
    return (matrices @ points[..., None])[..., 0], quats_wxyz
