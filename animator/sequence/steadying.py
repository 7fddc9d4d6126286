"""Steadying of the solved frames: takes out what is noise from frame to frame, bends nothing that is stiff."""

import dataclasses
import logging
from collections.abc import Callable, Sequence

from animator.sequence.driver import ClipProblem
from animator.sequence.rigid_body import RigidBodyConfig, as_rigid_body
from animator.sequence.smoothing import SmoothingConfig, beliefs_in, smooth_tracks
from animator.sequence.solved_frame import SolvedFrame
from animator.types import AnchorPoses

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SteadyingConfig:
    """What becomes of the tracks once every frame is solved."""

    smoothing: SmoothingConfig = dataclasses.field(default_factory=SmoothingConfig)
    rigid_body: RigidBodyConfig = dataclasses.field(default_factory=RigidBodyConfig)


def steadied(
    solved: Sequence[SolvedFrame],
    problem: ClipProblem,
    refit_rigid: Callable[[int, SolvedFrame], AnchorPoses],
    config: SteadyingConfig,
) -> list[SolvedFrame]:
    """Smooth the tracks; make one rigid body of what moves as one.

    Args:
        solved: The frames as solved one by one.
        problem: What they solve.
        refit_rigid: Fits a frame, by its index, again as one body from its rigid pose.
        config: How.

    Returns:
        The frames with steady poses.
    """
    anchors, diagonal = problem.anchors, problem.gaussians.diagonal
    beliefs = beliefs_in(solved, anchors, diagonal, config.smoothing)

    def smoothed(tracks: Sequence[AnchorPoses]) -> list[AnchorPoses]:
        return smooth_tracks(tracks, diagonal, config.smoothing, beliefs)

    def rigid(tracks: Sequence[AnchorPoses]) -> list[AnchorPoses] | None:
        return as_rigid_body(tracks, anchors, diagonal, config.rigid_body)

    tracks = smoothed([frame.poses for frame in solved])
    body = rigid(tracks)
    if body is None:
        return _posed(solved, tracks)
    logger.info("the object moves as one rigid body: fitting it again as one")
    refitted = [
        refit_rigid(index, frame) if index else frame.poses
        for index, frame in enumerate(_posed(solved, body))
    ]
    # Anchor by anchor, smoothing bends a little.
    return _posed(solved, rigid(smoothed(refitted)) or refitted)


def _posed(solved: Sequence[SolvedFrame], tracks: Sequence[AnchorPoses]) -> list[SolvedFrame]:
    return [
        dataclasses.replace(frame, poses=poses) for frame, poses in zip(solved, tracks, strict=True)
    ]
