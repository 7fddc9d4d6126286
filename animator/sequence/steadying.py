"""Steadying of the solved frames: takes out what is noise from frame to frame, bends nothing that is stiff."""

import dataclasses
import logging
from collections.abc import Sequence

from animator.sequence.driver import Driver
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
    solved: Sequence[SolvedFrame], driver: Driver, config: SteadyingConfig
) -> list[SolvedFrame]:
    """Smooth the tracks; make one rigid body of what moves as one.

    Args:
        solved: The frames as solved one by one.
        driver: What solved them; fits frames again and says how well they are explained.
        config: How.

    Returns:
        The frames with steady poses.
    """
    anchors, diagonal = driver.problem.anchors, driver.problem.gaussians.diagonal
    beliefs = beliefs_in(solved, anchors, diagonal, config.smoothing)

    def smoothed(tracks: Sequence[AnchorPoses]) -> list[AnchorPoses]:
        return smooth_tracks(tracks, diagonal, config.smoothing, beliefs)

    def rigid(tracks: Sequence[AnchorPoses]) -> list[AnchorPoses] | None:
        return as_rigid_body(tracks, anchors, diagonal, config.rigid_body)

    bending = _posed(solved, smoothed([frame.poses for frame in solved]))
    bodies = rigid([frame.poses for frame in bending])
    if bodies is None:
        return bending
    refitted = [
        driver.refit_rigid(index, frame) if index else frame.poses
        for index, frame in enumerate(_posed(solved, bodies))
    ]
    # Anchor by anchor, smoothing bends a little.
    stiff = _posed(solved, rigid(smoothed(refitted)) or refitted)
    enough = config.rigid_body.explained * driver.image_loss(0, stiff[0])
    for index in range(1, len(solved)):
        loss = driver.image_loss(index, stiff[index])
        if loss > enough and loss > driver.image_loss(index, bending[index]):
            return bending
    logger.info("the object moves as one rigid body")
    return stiff


def _posed(solved: Sequence[SolvedFrame], tracks: Sequence[AnchorPoses]) -> list[SolvedFrame]:
    return [
        dataclasses.replace(frame, poses=poses) for frame, poses in zip(solved, tracks, strict=True)
    ]
