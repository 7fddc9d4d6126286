"""Methods on one scene: fit or take what is there, score, and draw."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from animator.evaluation.fits import FitRequest, FittedMethod, fit_once
from animator.evaluation.methods import METHODS
from animator.evaluation.motion import Motion, motion_at_rest, motion_of_clip, read_motion
from animator.evaluation.perceptual import Judge
from animator.evaluation.scores import Scores, carried_points, point_tracks, score_result
from animator.evaluation.tasks import TASKS, Assignment, assign
from animator.evaluation.truth_scene import TruthScene
from animator.evaluation.uncertainty_check import UncertaintyScores, score_uncertainty
from animator.pipeline import FitConfig
from animator.render.protocol import Renderer
from animator.sequence.solved_frame import SolvedFrame
from exporters.clip import Clip, Tracks

LINEAR = "linear"
"""What a row of linear in-betweens is called, after its method."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class BenchmarkPlan:
    """What is done with every scene."""

    task: str
    """Key of `TASKS`."""
    methods: tuple[str, ...]
    """Keys of `METHODS`."""
    folder: Path
    """Where everything is kept."""
    config_with: Callable[[Mapping[str, bool]], FitConfig]
    """Returns what `animate` would use, with some of its switches changed."""
    renderer: Renderer
    """Draws results and truth."""
    judges: Mapping[str, Judge]
    """Perceptual measures."""
    frames: tuple[int, ...] | None = None
    """Only these frames."""
    seed: int = 0
    """Of the noise."""
    must_find_camera: bool = False
    """Whether the clip's camera is kept from the methods."""
    overwrite: bool = False
    """Fit again what is kept."""

    def result_folder(self, scene: TruthScene, method: str) -> Path:
        """Return where the result of a method on a scene is kept."""
        name = method if self.task == "clip" else f"{self.task}-{method}"
        if self.must_find_camera:
            name += "-auto-camera"
        return self.folder / scene.name / name


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Row:
    """One method on one scene: a row of the tables."""

    scene: str
    method: str
    gaussians: int
    """Of the result."""
    scores: Scores
    uncertainty: UncertaintyScores
    seconds_per_frame: float
    """Wall time of a solved frame [s]; NaN if nothing was solved here."""
    motion: Motion
    scored_numbers: tuple[int, ...]
    folder: Path
    """Where its pictures belong."""


def run_methods(
    scene: TruthScene,
    plan: BenchmarkPlan,
    on_frame: Callable[[str, int, int, SolvedFrame | None], None],
) -> Iterator[Row]:
    """Fit and score one method after another.

    Args:
        scene: The scene.
        plan: What to do.
        on_frame: Called with the method, the index of each solved frame, how many there are, and
            what is known of it.

    Raises:
        NotProvidedError: If the scene lacks what the task needs.
        InputError: If it cannot be fitted.
        WriteError: If a result cannot be kept.
    """
    assignment = assign(TASKS[plan.task], scene, frames=plan.frames, seed=plan.seed)
    if plan.must_find_camera:
        blind = dataclasses.replace(assignment.scene, frame_cameras=None)
        assignment = dataclasses.replace(assignment, scene=blind)
    for name in plan.methods:
        method = METHODS[name]
        request = FitRequest(
            method=method,
            assignment=assignment,
            config=plan.config_with(method.switches),
            folder=plan.result_folder(scene, name),
            name=f"{scene.name}, {name}",
        )

        def solved(index: int, frame: SolvedFrame | None, name: str = name) -> None:
            on_frame(name, index, len(assignment.scene.frames), frame)

        fitted = fit_once(request, plan.renderer, overwrite=plan.overwrite, on_frame=solved)
        for row_name, motion in _motions(name, fitted, assignment):
            yield score_row(
                row_name,
                scene,
                plan,
                dataclasses.replace(fitted, motion=motion.first_gaussians(assignment.model_size)),
                assignment.scored_numbers,
            )


def score_clip(path: Path, scene: TruthScene, plan: BenchmarkPlan) -> Row:
    """Score a result that is there already.

    Args:
        path: A saved clip, or a folder of one PLY a frame.
        scene: Its scene.
        plan: Which frames count: those given of the frames of the result, but the first.

    Raises:
        InputError: If it does not fit the scene.
        exporters.errors.ClipError: If the clip is damaged.
    """
    shown = plan.frames if plan.frames and path.is_dir() else scene.numbers
    motion, clip = read_motion(path, shown)
    if plan.frames is not None:
        motion = motion.take([number for number in motion.numbers if number in plan.frames])
    scored = tuple(number for number in motion.numbers if number != scene.numbers[0])
    fitted = FittedMethod(motion=motion, clip=clip, seconds_per_frame=float("nan"))
    return score_row("clip", scene, plan, fitted, scored)


def score_row(
    name: str,
    scene: TruthScene,
    plan: BenchmarkPlan,
    fitted: FittedMethod,
    scored_numbers: Sequence[int],
) -> Row:
    """Score one result."""
    motion = fitted.motion
    carried = carried_points(motion, scene)
    tracks = point_tracks(motion, carried, scene, scored_numbers)
    return Row(
        scene=scene.name,
        method=name,
        gaussians=len(motion.gaussians),
        scores=score_result(motion, tracks, scene, plan.renderer, plan.judges),
        uncertainty=score_uncertainty(fitted.clip, carried, tracks),
        seconds_per_frame=fitted.seconds_per_frame,
        motion=motion,
        scored_numbers=tuple(scored_numbers),
        folder=plan.result_folder(scene, name),
    )


def _motions(
    name: str, fitted: FittedMethod, assignment: Assignment
) -> Iterator[tuple[str, Motion]]:
    """Return what is scored of a result: as it is, or its in-betweens of two kinds."""
    if not assignment.inbetween:
        yield name, fitted.motion
    elif fitted.clip is None:
        # Nothing moves; tasks of in-betweens are refused for free Gaussians.
        yield name, motion_at_rest(fitted.motion.gaussians, assignment.numbers)
    else:
        times_s = [float(time_s) for time_s in fitted.clip.tracks.times_s]
        moments = list(zip(assignment.numbers, times_s, strict=True))
        yield name, motion_of_clip(fitted.clip, moments)
        yield f"{name}-{LINEAR}", motion_of_clip(_solved_keys_only(fitted.clip), moments)


def _solved_keys_only(clip: Clip) -> Clip:
    """Return the clip without its in-betweens: its joints move linearly from key to key."""
    keys = [key for key, number in enumerate(clip.source_frames) if number >= 0]
    tracks = Tracks(
        times_s=clip.tracks.times_s[keys],
        translations=clip.tracks.translations[keys],
        quats_wxyz=clip.tracks.quats_wxyz[keys],
    )
    return dataclasses.replace(clip, tracks=tracks, source_frames=(), camera=None, uncertainty=None)
