"""`animate`: frames and a splat to an animated, rigged asset."""

import logging
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from animator.commands.clip_files import write_clip_files
from animator.commands.exit_code import ExitCode
from animator.commands.fit_settings import (
    clip_labels,
    fit_config,
    frame_options,
    scene_overrides,
)
from animator.commands.outputs import OutputPlan
from animator.commands.plan_text import describe_plan
from animator.commands.progress import FrameProgress
from animator.commands.progress_file import ProgressFile, run_fingerprint
from animator.commands.run_report import FinishedRun, write_report
from animator.commands.threads import limit_threads
from animator.config import AnimateOptions
from animator.pipeline import Fit, fit
from animator.report.measurement import Measurement, measure
from animator.report.record import Summary
from animator.scene import Scene, discover, read_scene
from animator.sequence.solved_frame import SolvedFrame

if TYPE_CHECKING:
    from rich.console import Console

logger = logging.getLogger(__name__)


def run_animate(
    source: Path, options: AnimateOptions, plan: OutputPlan, console: "Console | None" = None
) -> ExitCode:
    """Read, fit, write, judge.

    Args:
        source: The frames.
        options: Every option.
        plan: Where everything goes; checked.
        console: The terminal, for a progress bar.

    Returns:
        `DONE`, `BELOW_QUALITY_GATE`, or `NOT_WRITTEN` if a file breaks a rule of its format:
        everything is written in all three cases.

    Raises:
        InputError: If an input cannot be used; nothing is written.
        WriteError: If an output cannot be written.
    """
    limit_threads(options.threads)
    started_s = time.monotonic()
    scene = load_scene(source, options)
    if options.dry_run:
        sys.stdout.write(describe_plan(scene, options, plan))
        return ExitCode.DONE
    for note in scene.notes:
        logger.info("%s", note)

    plan.make_folders()
    progress_file = _progress_file(scene, options, plan)
    watch = _Stopwatch(started_s)
    watch.lap("read")
    try:
        fitted = _fit(scene, options, plan, progress_file, console)
        watch.lap("fit")
        broken = write_clip_files(fitted.clip, plan, options)
        watch.lap("write")
        measurements = _measure(fitted, scene)
        watch.lap("measure")
    except KeyboardInterrupt:
        progress_file.announce()
        raise
    run = FinishedRun(
        scene=scene,
        options=options,
        plan=plan,
        fit=fitted,
        measurements=measurements,
        seconds=watch.seconds,
    )
    summary = write_report(run)
    progress_file.remove()
    verdict = _verdict(summary, plan)
    return ExitCode.NOT_WRITTEN if broken else verdict


def load_scene(source: Path, options: AnimateOptions) -> Scene:
    """Find and read the inputs.

    Raises:
        InputError: If one is missing or cannot be used.
    """
    return read_scene(discover(source, scene_overrides(options)), frame_options(options))


def _progress_file(scene: Scene, options: AnimateOptions, plan: OutputPlan) -> ProgressFile:
    assert plan.progress is not None, "animate plans all sidecars"
    progress_file = ProgressFile(plan.progress, run_fingerprint(scene, fit_config(options)))
    if plan.progress.exists() and not options.resume:
        logger.warning(
            "%s: an interrupted run left this; starting over (--resume would continue it).",
            plan.progress,
        )
    return progress_file


def _fit(
    scene: Scene,
    options: AnimateOptions,
    plan: OutputPlan,
    progress_file: ProgressFile,
    console: "Console | None",
) -> Fit:
    solved: tuple[SolvedFrame, ...] = ()
    if options.resume:
        solved = progress_file.resume(len(scene.frames))
    progress = FrameProgress(scene.frames.numbers, len(solved), console)

    def on_frame(index: int, frame: SolvedFrame) -> None:
        progress_file.keep(index, frame)
        progress.frame_done(index, frame.stats)

    with progress.shown():
        return fit(
            scene,
            clip_labels(options, scene, plan.assets[0]),
            fit_config(options),
            resume_from=solved,
            on_frame=on_frame,
        )


def _measure(fitted: Fit, scene: Scene) -> list[Measurement]:
    logger.info("Measuring %d frames for the report.", len(scene.frames))
    return list(measure(fitted, scene.frames))


class _Stopwatch:
    """Wall time of the parts of the run."""

    def __init__(self, started_s: float) -> None:
        self.seconds: dict[str, float] = {}
        self._last_s = started_s

    def lap(self, part: str) -> None:
        now_s = time.monotonic()
        self.seconds[part] = now_s - self._last_s
        self._last_s = now_s


def _verdict(summary: Summary, plan: OutputPlan) -> ExitCode:
    logger.info(
        "Mean PSNR %.2f dB, mean silhouette IoU %.3f, largest skin error %.2g %% of the diagonal.",
        summary.mean_psnr_db,
        summary.mean_silhouette_iou,
        summary.largest_skin_error_percent,
    )
    if summary.is_good:
        return ExitCode.DONE
    logger.error(
        "Below the quality gate: mean silhouette IoU %.3f, wanted %g (--min-iou). Everything is "
        "written; look at %s: is the camera right, and does the splat show the same object?",
        summary.mean_silhouette_iou,
        summary.min_iou,
        plan.report_html,
    )
    return ExitCode.BELOW_QUALITY_GATE
