"""A clip in which the whole object moves as one rigid body comes out exactly rigid.

Solved frame by frame, a stiff object keeps a small bend in every frame: noise that shows as a shiver of
the surface. If one rotation and one translation a frame explain the tracks up to that noise in every
frame, they are a candidate, which must then explain the frames (`steadying.py`). Small true deformations of
an otherwise rigid object stay as long as some anchor or some frame shows them.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from animator.types import AnchorPoses, Anchors


@dataclasses.dataclass(frozen=True, kw_only=True)
class RigidBodyConfig:
    """How near to rigid is rigid; all four must hold."""

    residual: float = 0.005
    """Largest RMS distance of the anchors from the best rigid fit in any frame [diagonals]; 0 switches
    it off."""
    local_residual: float = 0.007
    """Largest distance of any anchor and its neighbors, on average, in any frame [diagonals]: a part that moves by
    itself has several anchors, and one that has gone astray by itself is none."""
    motion_share: float = 0.15
    """Largest share that the residuals may be of the motion, both RMS over the clip."""
    explained: float = 1.3
    """Image loss of a frame, fitted again as one body, that is good enough, as a multiple of frame 0's;
    a larger one must at least not be worse than that of the bending object."""


def as_rigid_body(
    tracks: Sequence[AnchorPoses], anchors: Anchors, diagonal: float, config: RigidBodyConfig
) -> list[AnchorPoses] | None:
    """Replace tracks by the motion of one rigid body if they are as good as that.

    Args:
        tracks: Solved poses, T of them; the first may be anything but is fitted like the others.
        anchors: The anchors at rest.
        diagonal: The object's diagonal [scene unit].
        config: How near to rigid they must be.

    Returns:
        T rigid poses (Kabsch 1976), or None for an object that bends or hardly moves.
    """
    rest = anchors.positions.detach().cpu().numpy().astype(np.float64)
    if len(rest) < 3:
        return None
    shifts = np.stack([pose.translations.detach().cpu().numpy() for pose in tracks])
    center = rest.mean(axis=0)
    fits = [_best_turn(rest - center, rest + shift) for shift in shifts.astype(np.float64)]
    rigid = np.stack([turn.apply(rest - center) + place - rest for turn, place in fits])

    residuals = (rigid - shifts) / diagonal
    distances = np.linalg.norm(residuals, axis=2)
    around = np.linalg.norm(_with_neighbors(anchors) @ residuals, axis=2)
    motion = np.sqrt((shifts**2).sum(axis=2).mean()) / diagonal
    is_rigid = (
        np.sqrt((distances**2).mean(axis=1)).max() < config.residual
        and around.max() < config.local_residual
        and np.sqrt((distances**2).mean()) < config.motion_share * motion
    )
    if not is_rigid:
        return None
    return [
        AnchorPoses(
            quats_wxyz=torch.as_tensor(turn.as_quat(scalar_first=True))
            .to(pose.quats_wxyz)
            .expand_as(pose.quats_wxyz)
            .contiguous(),
            translations=torch.as_tensor(shift).to(pose.translations),
        )
        for pose, (turn, _), shift in zip(tracks, fits, rigid, strict=True)
    ]


def _with_neighbors(anchors: Anchors) -> np.ndarray:
    """Return the matrix that averages over each anchor and its neighbors, shape (A, A)."""
    linked = np.eye(len(anchors))
    first, second = anchors.edges.cpu().numpy().T
    linked[first, second] = linked[second, first] = 1.0
    return linked / linked.sum(axis=1, keepdims=True)


def _best_turn(centered: np.ndarray, moved: np.ndarray) -> tuple[Rotation, np.ndarray]:
    """Return the rotation and the new center that map centered points nearest to moved ones."""
    place = moved.mean(axis=0)
    return Rotation.align_vectors(moved - place, centered)[0], place
