"""`splatimate evaluate`: scores on scenes whose motion is known."""

import dataclasses
import logging
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from animator.commands.evaluate_arguments import SCENE_PLACEHOLDER, EvaluateChoices
from animator.commands.exit_code import ExitCode
from animator.commands.fit_settings import fit_config
from animator.commands.progress import describe_stats
from animator.commands.threads import limit_threads
from animator.config import AnimateOptions
from animator.errors import InputError
from animator.evaluation.benchmark import BenchmarkPlan, Row, run_methods, score_clip
from animator.evaluation.error_plot import error_plot
from animator.evaluation.fits import code_digest
from animator.evaluation.json_table import json_table
from animator.evaluation.methods import METHODS, chosen_methods
from animator.evaluation.perceptual import load_judges
from animator.evaluation.pictures import comparison_sheet
from animator.evaluation.table import markdown_table
from animator.evaluation.tasks import TASKS, NotProvidedError
from animator.evaluation.truth_scene import TruthScene, find_scenes, read_truth_scene
from animator.pipeline import FitConfig
from animator.render.registry import load_renderer
from animator.report.contact_sheet import png_bytes
from animator.sequence.solved_frame import SolvedFrame
from exporters.atomic import replacing
from exporters.errors import ClipError

logger = logging.getLogger(__name__)


def run_evaluate(choices: EvaluateChoices, options: AnimateOptions) -> ExitCode:
    """Fit what is not there yet, score, and write tables and pictures.

    Tables are written after every method, so that an interrupted run leaves what it has. A scene
    that cannot be used is named, and the others go on.

    Returns:
        `DONE`, or `BAD_INPUT` if a scene could not be used.

    Raises:
        InputError: If a choice makes no sense, or no scene could be used.
        WriteError: If a file cannot be written.
    """
    limit_threads(options.threads)
    folders = find_scenes(choices.scenes)
    plan = _plan(choices, options)
    _check(choices, options, plan, folders)
    table = _Table(choices.folder, choices.task)
    is_complete = True
    for folder in folders:
        try:
            scene = read_truth_scene(folder, plan.renderer)
            _evaluate_scene(scene, plan, choices, table)
        except NotProvidedError as missing:
            logger.warning("%s", missing)
            table.notes.append(f"{folder.name}: {missing}")
        except (InputError, ClipError) as error:
            logger.error("%s: left out: %s", folder, error)
            table.notes.append(f"{folder.name}: left out: {error}")
            is_complete = False
    if not table.rows:
        raise InputError(f"Nothing was scored. {' '.join(table.notes)}")
    sys.stdout.write(table.markdown())
    return ExitCode.DONE if is_complete else ExitCode.BAD_INPUT


class _Table:
    """The rows so far, and their two files."""

    def __init__(self, folder: Path, task: str) -> None:
        self._folder = folder
        self._task = task
        self.rows: list[Row] = []
        self.notes: list[str] = []

    def markdown(self) -> str:
        return markdown_table(self._task, self.rows, self.notes)

    def add(self, row: Row) -> None:
        # Poses are large, and no table needs them.
        nothing = dataclasses.replace(
            row.motion,
            numbers=(),
            positions=row.motion.positions[:0],
            quats_wxyz=row.motion.quats_wxyz[:0],
        )
        self.rows.append(dataclasses.replace(row, motion=nothing))
        contents = {
            f"{self._task}.md": self.markdown(),
            f"{self._task}.json": json_table(self._task, self.rows, self.notes, code_digest()),
        }
        for name, content in contents.items():
            _write(self._folder / name, content.encode())


def _plan(choices: EvaluateChoices, options: AnimateOptions) -> BenchmarkPlan:
    def config_with(switches: Mapping[str, bool]) -> FitConfig:
        return fit_config(dataclasses.replace(options, **switches))

    return BenchmarkPlan(
        task=choices.task,
        methods=chosen_methods(choices.methods),
        folder=choices.folder,
        config_with=config_with,
        renderer=load_renderer(options.device),
        judges=load_judges(choices.lpips_weights),
        frames=options.frames,
        seed=options.seed,
        must_find_camera=str(options.frame_camera) == "auto",
        overwrite=options.overwrite,
    )


def _check(
    choices: EvaluateChoices,
    options: AnimateOptions,
    plan: BenchmarkPlan,
    folders: Sequence[Path],
) -> None:
    """Refuse what makes no sense before any work."""
    if plan.must_find_camera != (options.frame_camera is not None):
        raise InputError(
            f"--frame-camera: expected auto, or nothing for the true camera, found "
            f"{options.frame_camera}."
        )
    if choices.clip is not None:
        if choices.task != "clip":
            raise InputError(
                f"--clip: the task {choices.task} fits anew; leave --clip or --task out."
            )
        if len(folders) > 1 and SCENE_PLACEHOLDER not in choices.clip:
            raise InputError(
                f"--clip: expected {SCENE_PLACEHOLDER} in the path, for there are {len(folders)} "
                f"scenes, found {choices.clip}."
            )
    free = [name for name in plan.methods if METHODS[name].kind == "free"]
    if free and TASKS[choices.task].is_interpolation:
        raise InputError(
            f"--methods: {', '.join(free)} has no in-betweens, so it cannot do {choices.task}."
        )


def _evaluate_scene(
    scene: TruthScene, plan: BenchmarkPlan, choices: EvaluateChoices, table: _Table
) -> None:
    def on_frame(method: str, index: int, count: int, solved: SolvedFrame | None) -> None:
        said = "" if solved is None else f": {describe_stats(solved.stats)}"
        logger.info("%s, %s, frame %d/%d%s", scene.name, method, index + 1, count, said)

    if choices.clip is not None:
        path = Path(choices.clip.replace(SCENE_PLACEHOLDER, scene.name))
        rows = iter([score_clip(path, scene, plan)])
    else:
        rows = run_methods(scene, plan, on_frame)
    for row in rows:
        logger.info("%s, %s: captured %.3f", row.scene, row.method, row.scores.motion.all.captured)
        sheet = comparison_sheet(row, scene, plan.renderer)
        _write(row.folder / "pictures.png", png_bytes(sheet))
        table.add(row)
        plot = error_plot([other for other in table.rows if other.scene == scene.name])
        _write(plan.folder / scene.name / f"{plan.task}_errors.svg", plot.encode())


def _write(path: Path, content: bytes) -> None:
    with replacing(path) as staged:
        staged.write_bytes(content)
