"""Every frame once more, with looser joints.

While limbs are being followed a stiff object is the better guide: with loose joints they come apart before they are
found. Once they are in place, the same stiffness keeps every bend too small, and all that moved too near its rest pose.
So each frame is solved again from where it is, with an energy that lets go sooner (graduated non-convexity, Blake and
Zisserman 1987).
"""

import dataclasses
import logging
from collections.abc import Sequence

from animator.deform.image_solver import ImageSolverConfig
from animator.sequence.driver import Driver
from animator.sequence.solved_frame import SolvedFrame
from animator.sequence.stopwatch import Stopwatch

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class LooseningConfig:
    """How much looser."""

    is_on: bool = True
    """Whether frames are solved again."""
    floor: float = 0.3
    """What is left of the floor of ARAP's norm, which holds together what bends [share]."""
    rest: float = 1 / 3
    """What is left of the pull to the rest pose [share]."""


def loosened(
    solved: Sequence[SolvedFrame], driver: Driver, config: LooseningConfig
) -> list[SolvedFrame]:
    """Solve frames again with looser joints.

    Args:
        solved: The frames, limbs in place.
        driver: What solved them.
        config: How much looser.

    Returns:
        The frames with other poses; what shows the rest pose keeps it.
    """
    if not config.is_on:
        return list(solved)
    if len(solved) > 1:
        logger.info("Solving every frame once more, with looser joints.")
    solver = driver.bare_solver.with_config(loose(driver.bare_solver.config, config))
    frames: list[SolvedFrame] = []
    for index, frame in enumerate(solved):
        poses = frame.poses
        watch = Stopwatch()
        if frame.stats.start == "held":
            poses = frames[-1].poses
        elif frame.stats.start != "rest":
            poses = solver.solve(driver.target_of(index, frame), poses)
            watch.lap("loosening")
        stats = dataclasses.replace(frame.stats, seconds={**frame.stats.seconds, **watch.seconds})
        frames.append(dataclasses.replace(frame, poses=poses, stats=stats))
    return frames


def loose(solver: ImageSolverConfig, config: LooseningConfig) -> ImageSolverConfig:
    """Return the configuration of a solver of looser joints."""
    norm, weights = solver.arap_norm, solver.weights
    return dataclasses.replace(
        solver,
        arap_norm=dataclasses.replace(norm, floor=config.floor * norm.floor),
        weights=dataclasses.replace(weights, rest=config.rest * weights.rest),
    )
