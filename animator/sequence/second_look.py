"""A second look at the solved frames, for limbs that lean the wrong way in depth.

A limb that once leans the wrong way mostly does so to the end of the clip, for every frame starts from the last.
So here and there in the clip limbs are turned over and the frame is solved again; if the energy of the image stage
says that this is the better pose, its neighbors are solved from it, as far as that helps them.

Frames are solved again without matches and rigid groups; what the first pass found of groups and uncertainty stays.
"""

import dataclasses
import logging
from collections.abc import Sequence

from animator.deform.depth_flips import FlipConfig, flipped_poses
from animator.deform.frame_target import FrameTarget
from animator.deform.limbs import find_limbs
from animator.sequence.driver import Driver
from animator.sequence.solved_frame import SolvedFrame, with_held_following
from animator.types import AnchorPoses

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SecondLookConfig:
    """Which frames are looked at, and what is kept."""

    every: int = 5
    """Frames from one that is looked at to the next, counted from the last; 0 switches it off."""
    most_flips: int = 3
    """Limbs of one frame that are turned over, one after the other."""
    nearly: float = 0.2
    """Share by which a flipped pose may cost more than the frame's own to be worth solving."""
    gain: float = 0.02
    """Share of the energy that a flipped limb must save, over the frame's own pose solved for as long."""
    spread_gain: float = 0.05
    """Share of its energy that a frame must save to take over the pose of its neighbor."""
    flips: FlipConfig = dataclasses.field(default_factory=FlipConfig)


def looked_at_again(
    solved: Sequence[SolvedFrame], driver: Driver, config: SecondLookConfig
) -> list[SolvedFrame]:
    """Turn limbs over in depth where that explains the frames better.

    Args:
        solved: The frames as solved one by one.
        driver: What solved them.
        config: Where, and what is kept.

    Returns:
        The frames, some with other poses.
    """
    if config.every == 0:
        return list(solved)
    if len(solved) > 1:
        logger.info("Looking again for limbs that lean the wrong way in depth.")
    look = _SecondLook(solved, driver, config)
    for index in range(len(solved) - 1, 0, -config.every):
        if look.flip(index):
            spread = look.spread(index, -1) + look.spread(index, 1)
            logger.info(
                "frame %d is explained better with a limb turned over in depth, and %d frames around it",
                driver.problem.frames.numbers[index],
                spread,
            )
    return look.frames()


class _SecondLook:
    """The frames on the way."""

    def __init__(
        self, solved: Sequence[SolvedFrame], driver: Driver, config: SecondLookConfig
    ) -> None:
        self._solved = list(solved)
        self._driver = driver
        self._solver = driver.bare_solver
        self._config = config
        self._limbs = find_limbs(driver.problem.anchors, config.flips.lengths)

    def flip(self, index: int) -> bool:
        """Turn limbs of a frame over in depth; return whether any stays so."""
        if self._is_held(index):
            return False
        flips = 0
        while flips < self._config.most_flips and self._flip_one(index):
            flips += 1
        return flips > 0

    def spread(self, index: int, step: int) -> int:
        """Solve the neighbors of a frame from its pose, one after the other, as long as it helps.

        Returns:
            The number of frames that were helped.
        """
        poses, helped = self._solved[index].poses, 0
        while 0 < index + step < len(self._solved):
            index += step
            if self._is_held(index):
                continue
            frame = self._solved[index]
            target = self._driver.target_of(index, frame)
            poses = self._solver.solve(target, poses)
            enough = (1.0 - self._config.spread_gain) * self._solver.energy(target, frame.poses)
            if self._solver.energy(target, poses) > enough:
                break
            self._keep(index, poses, "neighbor")
            helped += 1
        return helped

    def frames(self) -> list[SolvedFrame]:
        """Return the frames; those that show nothing new have the pose of the one they repeat."""
        return with_held_following(self._solved)

    def _flip_one(self, index: int) -> bool:
        frame = self._solved[index]
        target = self._driver.target_of(index, frame)
        start = self._likely_flip(frame, target)
        if start is None:
            return False
        flipped = self._solver.solve(target, start)
        if not self._solver.is_clearly_better(target, flipped, frame.poses, self._config.gain):
            return False
        self._keep(index, flipped, "flipped limb")
        return True

    def _likely_flip(self, frame: SolvedFrame, target: FrameTarget) -> AnchorPoses | None:
        """Return the pose with the limb turned over that costs least so; None if all cost far more."""
        anchors = self._driver.problem.anchors
        nearly = (1.0 + self._config.nearly) * self._solver.energy(target, frame.poses)
        likely = [
            (cost, limb, poses)
            for limb, poses in flipped_poses(
                anchors, frame.poses, frame.camera, self._limbs, self._config.flips
            )
            if (cost := self._solver.energy(target, poses)) < nearly
        ]
        if not likely:
            return None
        tip = min(likely, key=lambda flip: flip[0])[1].tip
        # The longest part of it: turned over at a joint too far out, it stays bent the wrong way farther in.
        return [poses for _, limb, poses in likely if limb.tip == tip][-1]

    def _keep(self, index: int, poses: AnchorPoses, start: str) -> None:
        frame = self._solved[index]
        stats = dataclasses.replace(frame.stats, start=start)
        self._solved[index] = dataclasses.replace(frame, poses=poses, stats=stats)

    def _is_held(self, index: int) -> bool:
        return self._solved[index].is_held
