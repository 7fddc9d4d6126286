"""Smoothing of the solved tracks: removes the tremble of frames solved one by one, keeps real motion.

Every frame has its own small error. A Whittaker smoother (1922) minimizes, for each anchor,
sum |x_t - y_t|^2 + strength * sum cost(|x_{t-1} - 2 x_t + x_{t+1}|^2), y the solved track. With plain
squares it would also round off real starts and stops; under a robust norm these cost no more than their
share, and only accelerations as small as the error are smoothed away.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch

from animator.deform.robust_norm import RobustNorm
from animator.types import AnchorPoses


@dataclasses.dataclass(frozen=True, kw_only=True)
class SmoothingConfig:
    """How strongly tracks are smoothed."""

    strength: float = 10.0
    """Weight of the acceleration; 0 leaves the tracks as they are."""
    norm: RobustNorm = RobustNorm(reach=0.004, floor=0.003)
    """What an acceleration costs [diagonals per frame^2]."""
    iterations: int = 8
    """Rounds of reweighting."""


def smooth_tracks(
    tracks: Sequence[AnchorPoses], diagonal: float, config: SmoothingConfig
) -> list[AnchorPoses]:
    """Smooth the anchors' tracks over the frames; the first frame stays.

    Rotations are smoothed by the weights that the translations' accelerations ask for, their
    quaternions as vectors: between neighboring frames they are close.

    Args:
        tracks: Solved poses, evenly spaced in time, T of them.
        diagonal: The object's diagonal [scene unit].
        config: How strongly.

    Returns:
        T poses with unit quaternions.
    """
    count = len(tracks)
    if count < 3 or config.strength <= 0:
        return list(tracks)
    shifts = np.stack([pose.translations.cpu().numpy() for pose in tracks]).astype(np.float64)
    quats = np.stack([pose.quats_wxyz.cpu().numpy() for pose in tracks]).astype(np.float64)
    flips = np.where(np.einsum("tai,tai->ta", quats[1:], quats[:-1]) < 0, -1.0, 1.0)
    quats[1:] *= np.cumprod(flips, axis=0)[..., None]

    second = np.diff(np.eye(count), 2, axis=0)
    fidelity = np.eye(count)
    fidelity[0, 0] = 1e6  # the first frame is the rest pose, exactly known
    smooth = shifts
    for _ in range(config.iterations):
        accelerations = np.einsum("st,tac->sac", second, smooth) / diagonal
        weights = config.norm.weight(np.einsum("sac,sac->sa", accelerations, accelerations))
        normal = fidelity + config.strength * np.einsum("sa,st,su->atu", weights, second, second)
        smooth = _solve(normal, fidelity, shifts)
    smooth_quats = _solve(normal, fidelity, quats)
    smooth_quats /= np.linalg.norm(smooth_quats, axis=-1, keepdims=True)
    return [tracks[0]] + [
        AnchorPoses(
            quats_wxyz=torch.as_tensor(turned, dtype=torch.float32).to(pose.quats_wxyz),
            translations=torch.as_tensor(shifted, dtype=torch.float32).to(pose.translations),
        )
        for turned, shifted, pose in zip(smooth_quats[1:], smooth[1:], tracks[1:], strict=True)
    ]


def _solve(normal: np.ndarray, fidelity: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Solve (A, T, T) x = fidelity values for values of shape (T, A, C)."""
    wanted = np.einsum("st,tac->asc", fidelity, values)
    return np.linalg.solve(normal, wanted).transpose(1, 0, 2)
