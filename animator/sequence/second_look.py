"""A second look at the solved frames, for limbs that lean the wrong way in depth.

A limb that once leans the wrong way mostly does so to the end of the clip, for every frame starts from the last.
So here and there in the clip limbs are turned over and the frame is solved again; if the energy of the image stage
says that this is the better pose, its neighbors are solved from it, as far as that helps them.
"""

import dataclasses
import logging
from collections.abc import Sequence

from animator.deform.depth_flips import FlipConfig, find_limbs, flipped_poses
from animator.sequence.driver import Driver
from animator.sequence.solved_frame import SolvedFrame
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
    look = _SecondLook(solved, driver, config)
    for index in range(len(solved) - 1, 0, -config.every):
        if look.flip(index):
            spread = look.spread(index, -1) + look.spread(index, 1)
            logger.info(
                "frame %d: explained better with a limb turned over in depth, and %d frames around it",
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
        self._config = config
        self._limbs = find_limbs(driver.problem.anchors, config.flips)

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
            poses = self._driver.solve_again(index, self._solved[index], poses)
            enough = (1.0 - self._config.spread_gain) * self._energy(index)
            if self._energy(index, poses) > enough:
                break
            self._keep(index, poses, "neighbor")
            helped += 1
        return helped

    def frames(self) -> list[SolvedFrame]:
        """Return the frames; those that show nothing new have the pose of the one they repeat."""
        frames: list[SolvedFrame] = []
        for index, frame in enumerate(self._solved):
            poses = frames[-1].poses if self._is_held(index) else frame.poses
            frames.append(dataclasses.replace(frame, poses=poses))
        return frames

    def _flip_one(self, index: int) -> bool:
        frame = self._solved[index]
        start = self._likely_flip(index)
        if start is None:
            return False
        flipped = self._driver.solve_again(index, frame, start)
        # Any pose gets better from being solved for longer: what counts is by how much more.
        straight = self._driver.solve_again(index, frame, frame.poses)
        if self._energy(index, flipped) > (1.0 - self._config.gain) * self._energy(index, straight):
            return False
        self._keep(index, flipped, "flipped limb")
        return True

    def _likely_flip(self, index: int) -> AnchorPoses | None:
        """Return the pose with the limb turned over that costs least so; None if all cost far more."""
        frame, problem = self._solved[index], self._driver.problem
        flips = flipped_poses(
            problem.anchors, frame.poses, frame.camera, self._limbs, self._config.flips
        )
        nearly = (1.0 + self._config.nearly) * self._energy(index)
        likely = [
            (cost, limb, poses)
            for limb, poses in flips
            if (cost := self._energy(index, poses)) < nearly
        ]
        if not likely:
            return None
        tip = min(likely, key=lambda flip: flip[0])[1].tip
        # The longest part of it: turned over at a joint too far out, it stays bent the wrong way farther in.
        return [poses for _, limb, poses in likely if limb.tip == tip][-1]

    def _energy(self, index: int, poses: AnchorPoses | None = None) -> float:
        frame = self._solved[index]
        return self._driver.energy(index, frame, frame.poses if poses is None else poses)

    def _keep(self, index: int, poses: AnchorPoses, start: str) -> None:
        frame = self._solved[index]
        stats = dataclasses.replace(frame.stats, start=start)
        self._solved[index] = dataclasses.replace(frame, poses=poses, stats=stats)

    def _is_held(self, index: int) -> bool:
        return self._solved[index].stats.start == "held"
