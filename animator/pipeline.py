"""The whole method, one line a stage: read this file first.

scene -> camera -> anchors -> frame-by-frame tracking -> second look -> smooth motion or free joints -> steadying
-> in-betweens -> clip
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Literal

from animator.deform.anchors import build_anchors, nearest_gaussians, with_sharper_skin
from animator.deform.floaters import without_floaters
from animator.match.registry import load_matcher
from animator.render.protocol import Renderer
from animator.render.registry import load_renderer
from animator.rig.bake import ClipLabels, Key, bake_clip
from animator.scene import Scene
from animator.sequence.cameras import locate_cameras
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.driver import Driver, DriverConfig
from animator.sequence.interpolation import InterpolationConfig, interpolate
from animator.sequence.loosening import LooseningConfig, loosened
from animator.sequence.rebinding import rebound
from animator.sequence.second_look import SecondLookConfig, looked_at_again
from animator.sequence.smooth_motion import (
    SmoothMotionConfig,
    moves_smoothly,
    solved_smoothly,
)
from animator.sequence.solved_frame import SolvedFrame
from animator.sequence.steadying import SteadyingConfig, steadied
from animator.threads import same_bytes_on_any_threads
from animator.types import (
    AnchorPoses,
    Anchors,
    AnchorUncertainty,
    Camera,
    Gaussians,
    RigidGroups,
)
from exporters.clip import Clip


@dataclasses.dataclass(frozen=True, kw_only=True)
class FitConfig:
    """Every choice of a fit; one set of defaults serves all scenes."""

    anchors: int = 200
    """Wanted number of anchors; becomes the number of joints less one, twice as many where the motion is smooth."""
    inbetween: int = 0
    """Smooth frames between two keys."""
    moving_camera: bool = False
    """Estimate the camera of every frame."""
    matcher: str = "auto"
    """`auto`, `flow`, `xfeat` or `roma`."""
    roma_weights: tuple[str, ...] = ()
    """Weight files for `roma`, brought by the user."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """`auto`, `cpu` or `cuda`."""
    seed: int = 0
    """Seed of every random choice."""
    driver: DriverConfig = dataclasses.field(default_factory=DriverConfig)
    second_look: SecondLookConfig = dataclasses.field(default_factory=SecondLookConfig)
    smooth_motion: SmoothMotionConfig = dataclasses.field(default_factory=SmoothMotionConfig)
    loosening: LooseningConfig = dataclasses.field(default_factory=LooseningConfig)
    steadying: SteadyingConfig = dataclasses.field(default_factory=SteadyingConfig)
    interpolation: InterpolationConfig = dataclasses.field(default_factory=InterpolationConfig)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Fit:
    """A finished fit: the clip, and what the report needs to judge it."""

    clip: Clip
    gaussians: Gaussians
    anchors: Anchors
    solved: tuple[SolvedFrame, ...]
    renderer: Renderer


@same_bytes_on_any_threads()
def fit(
    scene: Scene,
    labels: ClipLabels,
    config: FitConfig,
    *,
    resume_from: Sequence[SolvedFrame] = (),
    on_frame: Callable[[int, SolvedFrame], None] = lambda index, solved: None,
) -> Fit:
    """Animate the scene's Gaussians so that they follow its frames.

    Args:
        scene: Gaussians, frames and cameras.
        labels: Name, rate and axes of the clip.
        config: Every choice.
        resume_from: Frames 0..k-1 solved by an earlier, interrupted run of the same configuration.
        on_frame: Called with the index and the result after each frame.

    Returns:
        The clip with its solved frames.

    Raises:
        InputError: If the clip's camera cannot be found, or a backend is missing.
    """
    renderer = load_renderer(config.device)
    matcher = load_matcher(config.matcher, roma_weights=config.roma_weights)
    gaussians = scene.gaussians.to(renderer.device)
    solid = without_floaters(gaussians)
    cameras = locate_cameras(scene, solid, renderer)
    anchors = build_anchors(solid, target_count=config.anchors)
    problem = ClipProblem(
        gaussians=solid,
        anchors=anchors,
        frames=scene.frames,
        cameras=cameras,
        renderer=renderer,
        matcher=matcher,
        seed=config.seed,
        follow_camera=config.moving_camera,
    )
    driver = Driver(problem, config.driver)
    solved = _track(driver, resume_from, on_frame)
    solved = looked_at_again(solved, driver, config.second_look)
    if moves_smoothly(solved, driver, config.smooth_motion, config.loosening):
        solved, anchors = _solved_smoothly(solved, driver, config)
    else:
        solved = steadied(loosened(solved, driver, config.loosening), driver, config.steadying)
    groups = groups_of_anchors(solved[-1].groups, gaussians, anchors)
    keys = _keys(solved, scene, anchors, groups, labels.fps, config)
    clip = bake_clip(gaussians, anchors, groups, keys, labels)
    return Fit(
        clip=clip,
        gaussians=gaussians,
        anchors=anchors,
        solved=tuple(solved),
        renderer=renderer,
    )


def _track(
    driver: Driver,
    resume_from: Sequence[SolvedFrame],
    on_frame: Callable[[int, SolvedFrame], None],
) -> list[SolvedFrame]:
    solved = list(resume_from)
    if not solved:
        solved.append(driver.first())
        on_frame(0, solved[0])
    for index, frame in enumerate(driver.run(solved), start=len(solved)):
        on_frame(index, frame)
    return solved


def _solved_smoothly(
    solved: list[SolvedFrame], driver: Driver, config: FitConfig
) -> tuple[list[SolvedFrame], Anchors]:
    """Solve a smooth motion with a finer rig and steady it, in turns; return the anchors of that rig, too."""
    smooth_motion, problem = config.smooth_motion, driver.problem
    finer = build_anchors(
        problem.gaussians, target_count=round(smooth_motion.finer * config.anchors)
    )
    anchors = with_sharper_skin(finer, smooth_motion.sharpness)
    solved = rebound(solved, problem.gaussians, problem.anchors, anchors)
    driver = driver.with_anchors(anchors, solved[0])
    for _ in range(smooth_motion.rounds):
        solved = solved_smoothly(solved, driver, smooth_motion, config.loosening)
        solved = steadied(solved, driver, config.steadying)
    return solved, anchors


def groups_of_anchors(groups: RigidGroups, gaussians: Gaussians, anchors: Anchors) -> RigidGroups:
    """Give each anchor the rigid group of its nearest Gaussian."""
    return RigidGroups(labels=groups.labels[nearest_gaussians(gaussians, anchors)])


def _keys(
    solved: Sequence[SolvedFrame],
    scene: Scene,
    anchors: Anchors,
    groups: RigidGroups,
    fps: float,
    config: FitConfig,
) -> list[Key]:
    """Lay the solved frames and their in-betweens on the time line, one frame apart."""
    tracks = [frame.poses for frame in solved]
    between = interpolate(anchors, groups, tracks, config.inbetween, config.interpolation)
    moments: list[tuple[int, AnchorPoses, Camera, AnchorUncertainty | None]] = []
    for index, frame in enumerate(solved):
        if index:
            before = solved[index - 1]
            known = None
            if before.uncertainty is not None and frame.uncertainty is not None:
                known = before.uncertainty.or_larger(frame.uncertainty)
            moments += [(-1, pose, before.camera, known) for pose in between[index - 1]]
        number = scene.frames.numbers[index]
        moments.append((number, frame.poses, frame.camera, frame.uncertainty))
    return [
        Key(time_s=k / fps, source_frame=number, poses=poses, camera=camera, uncertainty=known)
        for k, (number, poses, camera, known) in enumerate(moments)
    ]
