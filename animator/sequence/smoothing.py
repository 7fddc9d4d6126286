"""Smoothing of the solved tracks: removes the tremble of frames solved one by one, keeps real motion.

Every frame has its own small error. A Whittaker smoother (1922) minimizes, for each anchor,
sum (x_t - y_t)^T B_t (x_t - y_t) + strength * sum cost(|x_{t-1} - 2 x_t + x_{t+1}|^2), y the solved track.
B_t says how far the frame's solution is to be believed, by direction: less along the viewing ray than
across it, and less where no match held it. With plain squares of the accelerations it would also round
off real starts and stops. Cauchy's norm lets go of these, the more the larger they are, down to a floor;
accelerations as small as the error are smoothed away. But an acceleration is real only as far as the places
that it is made of are believed: a hidden limb that jumps where it comes out was not where it was thought to be.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch
from scipy.linalg import solveh_banded

from animator.sequence.solved_frame import SolvedFrame
from animator.types import AnchorPoses, Anchors

_EXACT = 1e6
"""Belief in what is known."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SmoothingConfig:
    """How strongly tracks are smoothed."""

    strength: float = 2.0
    """Weight of the acceleration; 0 leaves the tracks as they are."""
    reach: float = 0.0022
    """Acceleration of half the weight of a tiny one where all is believed [diagonals per frame^2]; infinite for plain
    squares."""
    floor: float = 0.004
    """Least weight of an acceleration."""
    believed: float = 0.0015
    """Standard deviation of a place up to which it is fully believed [diagonals]."""
    least_belief: float = 0.05
    """What is left of the belief in a place that nothing shows."""
    iterations: int = 8
    """Rounds of reweighting."""


def beliefs_in(
    frames: Sequence[SolvedFrame], anchors: Anchors, diagonal: float, config: SmoothingConfig
) -> np.ndarray:
    """Say how far the places of the anchors are to be believed, by direction.

    Args:
        frames: Solved frames, T of them; one that does not know its uncertainty is believed.
        anchors: The anchors at rest.
        diagonal: The object's diagonal [scene unit].
        config: What is believed.

    Returns:
        Symmetric matrices with eigenvalues up to 1, full belief; float64, shape (T, A, 3, 3).
    """
    beliefs = np.tile(np.eye(3), (len(frames), len(anchors), 1, 1))
    for index, frame in enumerate(frames):
        if frame.uncertainty is None:
            continue
        along, across = (
            np.clip((config.believed * diagonal / sigmas) ** 2, config.least_belief, 1.0)
            for sigmas in (frame.uncertainty.along_ray, frame.uncertainty.across_ray)
        )
        rays = _rays_to(anchors, frame)
        beliefs[index] *= across[:, None, None]
        beliefs[index] += np.einsum("a,ai,aj->aij", along - across, rays, rays)
    return beliefs


def firmer_across_rays(
    beliefs: np.ndarray, frame: SolvedFrame, anchors: Anchors, factors: np.ndarray
) -> np.ndarray:
    """Believe places of one frame more, as far as its picture tells of them: across the rays only.

    Args:
        beliefs: Of this frame, shape (A, 3, 3).
        frame: The frame.
        anchors: The anchors at rest.
        factors: How many times more, at least 1, shape (A,).

    Returns:
        The new beliefs; they may exceed 1.
    """
    rays = _rays_to(anchors, frame)
    across = np.eye(3) - np.einsum("ai,aj->aij", rays, rays)
    return beliefs + (factors - 1.0)[:, None, None] * (across @ beliefs @ across)


def smooth_tracks(
    tracks: Sequence[AnchorPoses],
    diagonal: float,
    config: SmoothingConfig,
    beliefs: np.ndarray | None = None,
) -> list[AnchorPoses]:
    """Smooth the anchors' tracks over the frames; the first frame stays.

    Rotations are smoothed by the weights that the translations' accelerations ask for, their
    quaternions as vectors: between neighboring frames they are close.

    Args:
        tracks: Solved poses, evenly spaced in time, T of them.
        diagonal: The object's diagonal [scene unit].
        config: How strongly.
        beliefs: See `beliefs_in`, shape (T, A, 3, 3); None believes all alike.

    Returns:
        T poses with unit quaternions.
    """
    count = len(tracks)
    if count < 3 or config.strength <= 0:
        return list(tracks)
    shifts = np.stack([pose.translations.cpu().numpy() for pose in tracks], axis=1)
    shifts = shifts.astype(np.float64)
    quats = np.stack([pose.quats_wxyz.cpu().numpy() for pose in tracks], axis=1).astype(np.float64)
    flips = np.where(np.einsum("ati,ati->at", quats[:, 1:], quats[:, :-1]) < 0, -1.0, 1.0)
    quats[:, 1:] *= np.cumprod(flips, axis=1)[..., None]
    if beliefs is None:
        beliefs = np.tile(np.eye(3), (count, len(shifts), 1, 1))
    beliefs = beliefs.swapaxes(0, 1).copy()
    in_accelerations = (beliefs[:, :-2] + beliefs[:, 1:-1] + beliefs[:, 2:]) / 3
    beliefs[:, 0] = _EXACT * np.eye(3)  # the first frame is the rest pose, exactly known

    smooth, stiffness = shifts, np.zeros((len(shifts), 3, count))
    for _ in range(config.iterations):
        accelerations = np.diff(smooth, 2, axis=1) / diagonal
        real = np.einsum("ati,atij,atj->at", accelerations, in_accelerations, accelerations)
        weights = config.floor + (1.0 - config.floor) / (1.0 + real / config.reach**2)
        stiffness = config.strength * _bands_of_accelerations(weights)
        smooth = _smoothed(shifts, beliefs, stiffness)
    belief_in_turns = np.trace(beliefs, axis1=2, axis2=3)[..., None, None] / 3
    smooth_quats = _smoothed(quats, belief_in_turns, stiffness)
    smooth_quats /= np.linalg.norm(smooth_quats, axis=-1, keepdims=True)
    return [tracks[0]] + [
        AnchorPoses(
            quats_wxyz=torch.as_tensor(smooth_quats[:, t], dtype=torch.float32).to(pose.quats_wxyz),
            translations=torch.as_tensor(smooth[:, t], dtype=torch.float32).to(pose.translations),
        )
        for t, pose in enumerate(tracks)
        if t
    ]


def _rays_to(anchors: Anchors, frame: SolvedFrame) -> np.ndarray:
    """Return unit vectors from the camera to the places of the anchors, shape (A, 3)."""
    places = (anchors.positions + frame.poses.translations).detach().cpu().numpy()
    rays = places - frame.camera.position
    return rays / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)


def _bands_of_accelerations(weights: np.ndarray) -> np.ndarray:
    """Return sum w_s d_s d_s^T with d = (1, -2, 1) as diagonals 0 to 2 below the main one.

    Args:
        weights: Weights of T - 2 accelerations, shape (A, T - 2).

    Returns:
        Shape (A, 3, T).
    """
    first, middle, last = (np.pad(weights, ((0, 0), (k, 2 - k))) for k in range(3))
    return np.stack([first + 4 * middle + last, -2 * (first + middle), first], axis=1)


def _smoothed(values: np.ndarray, beliefs: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Minimize sum (x_t - y_t)^T B_t (x_t - y_t) + x^T K x for every anchor.

    Args:
        values: y, shape (A, T, C).
        beliefs: B, of the channels together, shape (A, T, C, C), or of each alike, (A, T, 1, 1).
        stiffness: K by its diagonals, the same for every channel, shape (A, 3, T).

    Returns:
        x, shape (A, T, C).
    """
    anchors, count, channels = values.shape
    coupled = beliefs.shape[-1]  # unknowns of one frame that depend on each other
    bands = np.zeros((anchors, 2 * coupled + 1, count, coupled))
    for column in range(coupled):
        for row in range(column, coupled):
            bands[:, row - column, :, column] = beliefs[:, :, row, column]
    bands[:, ::coupled] += stiffness[..., None]
    wanted = beliefs @ values.reshape(anchors, count, coupled, channels // coupled)
    return np.stack(
        [
            solveh_banded(
                band.reshape(len(band), -1), right.reshape(count * coupled, -1), lower=True
            )
            for band, right in zip(bands, wanted, strict=True)
        ]
    ).reshape(values.shape)
