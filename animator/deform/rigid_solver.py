"""The image stage of a wholly rigid object: one rotation and one translation, nothing to hold it back.

The energy of bending objects pulls at a rigid one, too: what hardly moves is held at rest, and a small
bend is cheap. Six unknowns need no such help.
"""

import dataclasses

import torch

from animator import quaternions
from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import ImageSolver
from animator.deform.pace import PaceConfig, descend
from animator.types import AnchorPoses, Anchors


@dataclasses.dataclass(frozen=True, kw_only=True)
class RigidSolverConfig:
    """The optimizer of a rigid pose."""

    turn_rate: float = 4e-3
    """Learning rate of the quaternion."""
    shift_rate: float = 2e-3
    """Learning rate of the translation [diagonals]."""
    pace: PaceConfig = dataclasses.field(default_factory=PaceConfig)
    """How many Adam steps a frame gets."""
    match_weight: float = 30.0
    """Weight of matches (Eq. 3) against the picture: a body follows them all at once, so few wrong ones do no harm."""


def solve_rigid(
    image_solver: ImageSolver,
    anchors: Anchors,
    target: FrameTarget,
    start: AnchorPoses,
    config: RigidSolverConfig,
) -> AnchorPoses:
    """Move a posed object as one body to where it explains the frame best.

    Args:
        image_solver: Measures how well a pose explains the frame.
        anchors: The anchors at rest.
        target: The frame, with matches if there are any.
        start: Where it begins; kept if nothing explains the frame better.
        config: The optimizer.

    Returns:
        The start, turned about its middle and shifted.
    """
    diagonal = image_solver.gaussians.diagonal
    places = anchors.positions + start.translations
    middle = places.mean(dim=0)
    turn = torch.tensor([1.0, 0.0, 0.0, 0.0], device=places.device, requires_grad=True)
    shift = torch.zeros(3, device=places.device, requires_grad=True)

    def moved() -> AnchorPoses:
        turns = quaternions.normalize(turn[None]).expand(len(places), 4)
        turned = quaternions.rotate(turns, places - middle) + middle
        return AnchorPoses(
            quats_wxyz=quaternions.multiply(turns, start.quats_wxyz),
            translations=turned + shift * diagonal - anchors.positions,
        )

    def loss_of(poses: AnchorPoses) -> torch.Tensor:
        posed = image_solver.pose(poses)
        return image_solver.image_loss(posed, target) + (
            config.match_weight * image_solver.match_loss(posed, target)
        )

    unknowns = [
        {"params": [turn], "lr": config.turn_rate},
        {"params": [shift], "lr": config.shift_rate},
    ]
    descend(unknowns, config.pace, lambda _: loss_of(moved()))
    with torch.no_grad():
        best = moved()
        return best if loss_of(best) < loss_of(start) else start
