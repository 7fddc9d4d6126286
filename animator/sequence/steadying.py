"""Steadying of the solved frames: takes out what is noise from frame to frame, bends nothing that is stiff."""

import dataclasses
import logging
from collections.abc import Sequence

import numpy as np

from animator.sequence.driver import Driver
from animator.sequence.rigid_body import RigidBodyConfig, as_rigid_body
from animator.sequence.smoothing import (
    SmoothingConfig,
    beliefs_in,
    firmer_across_rays,
    smooth_tracks,
)
from animator.sequence.solved_frame import SolvedFrame
from animator.types import AnchorPoses

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SteadyingConfig:
    """What becomes of the tracks once every frame is solved."""

    smoothing: SmoothingConfig = dataclasses.field(default_factory=SmoothingConfig)
    rigid_body: RigidBodyConfig = dataclasses.field(default_factory=RigidBodyConfig)
    spoilt: float = 1.3
    """Times the loss of a frame's picture before, above which smoothing has spoilt it."""
    firmer: float = 4.0
    """How many times more what is seen in a spoilt frame is believed, each round."""
    rounds: int = 3
    """Rounds of smoothing and looking at the pictures."""


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
    beliefs = _beliefs(solved, driver, config)

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


def _beliefs(solved: Sequence[SolvedFrame], driver: Driver, config: SteadyingConfig) -> np.ndarray:
    """Believe what the matches determine, and more of it in frames whose picture smoothing would spoil.

    A belief errs on the side of smoothing where there are no matches: a head that rolls fast is seen well all the same.
    """
    anchors, diagonal = driver.problem.anchors, driver.problem.gaussians.diagonal
    beliefs = beliefs_in(solved, anchors, diagonal, config.smoothing)
    enough = [config.spoilt * driver.image_loss(index, frame) for index, frame in enumerate(solved)]
    tracks = [frame.poses for frame in solved]
    for _ in range(config.rounds):
        steady = _posed(solved, smooth_tracks(tracks, diagonal, config.smoothing, beliefs))
        spoilt = [
            index
            for index, frame in enumerate(steady)
            if driver.image_loss(index, frame) > enough[index]
        ]
        if not spoilt:
            break
        for index in spoilt:
            factors = 1.0 + (config.firmer - 1.0) * driver.seen_shares(solved[index])
            beliefs[index] = firmer_across_rays(beliefs[index], solved[index], anchors, factors)
    return beliefs


def _posed(solved: Sequence[SolvedFrame], tracks: Sequence[AnchorPoses]) -> list[SolvedFrame]:
    return [
        dataclasses.replace(frame, poses=poses) for frame, poses in zip(solved, tracks, strict=True)
    ]
