"""A clip whose motion is smooth in space, as of a plant in the wind, is solved as such.

With free joints (`loosening.py`) anchors explain more than the motion: where an image says little, each gets a depth
of its own. Few nodes that share a motion with what is near say less, and right where the object moves like that. Which
it is, the frames say: both are fitted to every other cell of some frames, and must tell what the cells between them
show (cross-validation, Stone 1974).
"""

import dataclasses
import logging
from collections.abc import Sequence

import numpy as np

from animator.deform.image_solver import ImageSolverConfig
from animator.deform.smooth_field import SmoothField, SmoothFieldConfig
from animator.sequence.driver import Driver
from animator.sequence.hidden_cells import halves
from animator.sequence.loosening import LooseningConfig, loose
from animator.sequence.rigid_body import RigidBodyConfig, as_rigid_body
from animator.sequence.solved_frame import SolvedFrame, with_held_following
from animator.sequence.stopwatch import Stopwatch

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SmoothMotionConfig:
    """When a motion is smooth, and how such a motion is solved."""

    residual: float = 0.06
    """Distance of the anchors from the nearest smooth pose, as a share of the motion, both RMS, above which
    a motion is not smooth; 0 switches it off."""
    worse: float = 1.09
    """Times the loss in hidden cells with free joints, above which it is not smooth either."""
    cells: float = 8.0
    """Cells along the object's size."""
    looks: tuple[float, ...] = (0.25, 0.5, 1.0)
    """Which frames decide, as shares of the clip."""
    arap: float = 2.0
    """Times the weight of ARAP with free joints."""
    rest: float = 3.0
    """Times the weight of the pull to rest."""
    rigid_body: RigidBodyConfig = dataclasses.field(default_factory=RigidBodyConfig)
    """What is as good as rigid is left as it is: `steadying.py` makes one body of it."""
    field: SmoothFieldConfig = dataclasses.field(default_factory=SmoothFieldConfig)
    rounds: int = 2
    """How often frames are solved and steadied: from where its neighbors say it is, a frame finds a better pose."""
    finer: float = 2.0
    """Times the anchors: what bends everywhere needs more of them than what bends at joints."""
    sharpness: float = 4.0
    """Power of the skinning weights: neighbors that move alike need not be mixed, and leaves that touch
    must not be."""


def moves_smoothly(
    solved: Sequence[SolvedFrame],
    driver: Driver,
    config: SmoothMotionConfig,
    loosening: LooseningConfig,
) -> bool:
    """Tell whether the motion of a clip is smooth in space.

    Args:
        solved: The frames, limbs in place.
        driver: What solved them.
        config: When it is.
        loosening: The other choice: free joints.

    Returns:
        Whether it is; never for what does not move, or moves as one body.
    """
    moving = _moving(solved)
    if not moving or config.residual == 0.0:
        return False
    anchors, diagonal = driver.problem.anchors, driver.problem.gaussians.diagonal
    tracks = [frame.poses for frame in solved]
    if as_rigid_body(tracks, anchors, diagonal, config.rigid_body) is not None:
        return False
    trial = _Trial(solved, driver, config, loosening)
    deciding = sorted({moving[round(share * (len(moving) - 1))] for share in config.looks})
    if any(trial.residual(index) > config.residual for index in deciding):
        return False
    driver.light_stage.learn_afresh(solved)
    smoothly, freely = np.sum([trial.hidden_losses(index) for index in deciding], axis=0)
    logger.debug("loss in hidden cells: %.4f smoothly, %.4f with free joints", smoothly, freely)
    is_smooth = bool(smoothly <= config.worse * freely)
    if is_smooth:
        logger.info("The object moves smoothly, without joints.")
    return is_smooth


def solved_smoothly(
    solved: Sequence[SolvedFrame],
    driver: Driver,
    config: SmoothMotionConfig,
    loosening: LooseningConfig,
) -> list[SolvedFrame]:
    """Solve the frames again by a motion that is smooth in space.

    Args:
        solved: The frames, limbs in place.
        driver: Looks at them; its rig has `config.finer` times the anchors that tracked them.
        config: How.
        loosening: How the energy differs from that of tracking, as with free joints.

    Returns:
        The frames with other poses; what shows the rest pose keeps its own.
    """
    moving = _moving(solved)
    logger.info("Solving %d frames once more, by a smooth motion.", len(moving))
    driver.light_stage.learn_afresh(solved)
    free = loose(driver.bare_solver.config, loosening)
    solver = driver.bare_solver.with_config(on_finer_rig(smooth(free, config), config.finer))
    field = SmoothField(driver.problem.anchors, driver.problem.gaussians.diagonal, config.field)
    frames = list(solved)
    for index in moving:
        watch = Stopwatch()
        frame = solved[index]
        target = driver.matched_target_of(index, frame)
        poses = solver.solve_smoothly(field, target, frame.poses)
        watch.lap("smooth motion")
        frames[index] = frame.solved_again(poses, watch.seconds)
    return with_held_following(frames)


def _moving(solved: Sequence[SolvedFrame]) -> list[int]:
    return [index for index, frame in enumerate(solved) if frame.was_solved]


class _Trial:
    """The frames, by a smooth motion and with free joints."""

    def __init__(
        self,
        solved: Sequence[SolvedFrame],
        driver: Driver,
        config: SmoothMotionConfig,
        loosening: LooseningConfig,
    ) -> None:
        self._solved = solved
        self._driver = driver
        self._config = config
        problem = driver.problem
        self._field = SmoothField(problem.anchors, problem.gaussians.diagonal, config.field)
        free = loose(driver.bare_solver.config, loosening)
        self._free_solver = driver.bare_solver.with_config(free)
        self._solver = driver.bare_solver.with_config(smooth(free, config))

    def residual(self, index: int) -> float:
        """Measure how far a frame's pose is from a smooth one, as a share of its motion."""
        frame = self._solved[index]
        shifts = frame.poses.translations
        near = self._field.near(frame.poses, frame.camera).translations
        return float((near - shifts).norm() / shifts.norm().clamp_min(1e-12))

    def hidden_losses(self, index: int) -> tuple[float, float]:
        """Tell how badly cells of a frame that were hidden are explained, smoothly and with free joints."""
        start = self._solved[index].poses
        smoothly = freely = 0.0
        target = self._driver.matched_target_of(index, self._solved[index])
        for shown, hidden in halves(target, self._config.cells):
            poses = self._solver.solve_smoothly(self._field, shown, start)
            smoothly += self._solver.image_loss(hidden, poses)
            poses = self._free_solver.solve(shown, start)
            freely += self._free_solver.image_loss(hidden, poses)
        return smoothly, freely


def smooth(free: ImageSolverConfig, config: SmoothMotionConfig) -> ImageSolverConfig:
    """Return the configuration of a solver of smooth motions."""
    weights = dataclasses.replace(
        free.weights, arap=config.arap * free.weights.arap, rest=config.rest * free.weights.rest
    )
    return dataclasses.replace(free, weights=weights)


def on_finer_rig(solver: ImageSolverConfig, finer: float) -> ImageSolverConfig:
    """Return the same for a rig of so many times the anchors.

    On a surface, edges are shorter by the root of it, and a bend moves a neighbor from where it would be by its
    curvature times the square of the edge: residuals of ARAP are smaller by the whole of it. So its reach is, and
    what it costs beyond that is the same as before.
    """
    norm, weights = solver.arap_norm, solver.weights
    return dataclasses.replace(
        solver,
        arap_norm=dataclasses.replace(norm, reach=norm.reach / finer),
        weights=dataclasses.replace(weights, arap=weights.arap * finer**2),
    )
