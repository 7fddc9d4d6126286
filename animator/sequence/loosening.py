"""The frames once more, with free joints between stiff parts.

While limbs are being followed, an object that resists every bend is the better guide: with free joints they come apart
before they are found. Once they are in place, the same resistance keeps every bend too small. So frames are solved
again from where they are, with an energy that holds parts together tighter and lets go of joints that clearly bend
(graduated non-convexity, Blake and Zisserman 1987). What that changes is alike in neighboring frames: where steps are
small, those in between take it over from the frames around them.
"""

import dataclasses
import logging
from collections.abc import Mapping, Sequence

from animator.deform.image_solver import ImageSolverConfig
from animator.deform.pace import PaceConfig
from animator.sequence.driver import Driver
from animator.sequence.interpolation import blend
from animator.sequence.pose_change import carried, step_length
from animator.sequence.solved_frame import SolvedFrame, with_held_following
from animator.sequence.stopwatch import Stopwatch

logger = logging.getLogger(__name__)

_PATIENT = PaceConfig(most_steps=400, window=20, gain=0.004, settling_steps=50)


@dataclasses.dataclass(frozen=True, kw_only=True)
class LooseningConfig:
    """How the energy changes, and in which frames."""

    every: int = 4
    """Frames from one that is solved again to the next; 0 switches it off."""
    far: float = 0.08
    """Step of the fastest twentieth of the anchors, from the frame before, after which a frame is solved again in any
    case [diagonals]."""
    floor: float = 0.03
    """Times the floor of ARAP's norm, which holds together what bends."""
    arap: float = 3.0
    """Times the weight of ARAP: parts are stiffer."""
    rotation: float = 1.0 / 3.0
    """Times the weight of rotation differences: what bends smoothly, a tail or a trunk, may bend more."""
    rgb: float = 2.0
    """Times the weight of color: in the light that is known by now, it says how surfaces turned."""
    deform: float = 30.0
    """Times the weight of matches, which are found anew from where a frame is: by now they are short and right."""
    smoothing: float = 1.0
    """Strength of the preconditioner: less than while tracking, for neighbors at a joint do not move alike."""
    pace: PaceConfig = _PATIENT
    """How many steps a frame gets: more than while tracking. The last of them find depth, and what a frame is left
    with here is final."""


def loosened(
    solved: Sequence[SolvedFrame], driver: Driver, config: LooseningConfig
) -> list[SolvedFrame]:
    """Solve frames again with free joints.

    Args:
        solved: The frames, limbs in place.
        driver: What solved them.
        config: How the energy changes, and where.

    Returns:
        The frames with other poses; what shows the rest pose keeps it.
    """
    if config.every == 0:
        return list(solved)
    if len(solved) > 1:
        logger.info("Solving frames once more, with free joints.")
    driver.light_stage.learn_afresh(solved)
    solver = driver.bare_solver.with_config(loose(driver.bare_solver.config, config))
    chosen = _chosen(solved, driver.problem.gaussians.diagonal, config)
    changed = {0: solved[0]}
    for index in chosen:
        watch = Stopwatch()
        frame = solved[index]
        poses = solver.solve(driver.matched_target_of(index, frame), frame.poses)
        watch.lap("loosening")
        changed[index] = frame.solved_again(poses, watch.seconds)
    return with_held_following(
        [
            frame if frame.is_held else changed.get(index) or _carried(index, solved, changed)
            for index, frame in enumerate(solved)
        ]
    )


def loose(solver: ImageSolverConfig, config: LooseningConfig) -> ImageSolverConfig:
    """Return the configuration of a solver of free joints."""
    norm, weights = solver.arap_norm, solver.weights
    return dataclasses.replace(
        solver,
        arap_norm=dataclasses.replace(norm, floor=config.floor * norm.floor),
        smoothing=config.smoothing,
        pace=config.pace,
        weights=dataclasses.replace(
            weights,
            arap=config.arap * weights.arap,
            rotation=config.rotation * weights.rotation,
            rgb=config.rgb * weights.rgb,
            deform=config.deform * weights.deform,
        ),
    )


def _chosen(solved: Sequence[SolvedFrame], diagonal: float, config: LooseningConfig) -> list[int]:
    """Choose the frames to solve: at least every so many, every far one, and the last."""
    moving = [index for index, frame in enumerate(solved) if frame.was_solved]
    chosen: list[int] = []
    last = 0
    for index in moving:
        is_far = index and (
            step_length(solved[index - 1].poses, solved[index].poses) > config.far * diagonal
        )
        if is_far or index - last >= config.every or index in (0, moving[-1]):
            chosen.append(index)
            last = index
    return chosen


def _carried(
    index: int, solved: Sequence[SolvedFrame], changed: Mapping[int, SolvedFrame]
) -> SolvedFrame:
    """Change a frame's pose by what changed in the frames around it, in proportion to their nearness."""
    frame = solved[index]
    before = max(other for other in changed if other < index)
    after = min(other for other in changed if other > index)
    one, other = (carried(solved[k].poses, changed[k].poses, frame.poses) for k in (before, after))
    share = (index - before) / (after - before)
    return dataclasses.replace(frame, poses=blend(one, other, share))
