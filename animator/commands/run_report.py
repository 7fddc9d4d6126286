"""Measure a finished fit, and write its report in all formats."""

import dataclasses
import logging
import math
from collections.abc import Sequence
from typing import Any

from animator.commands.export_choices import CHOICES, export_options
from animator.commands.outputs import OutputPlan
from animator.commands.version import package_versions
from animator.config import AnimateOptions
from animator.pipeline import Fit
from animator.report.contact_sheet import contact_sheet, png_bytes
from animator.report.html_report import html_report
from animator.report.json_report import json_report
from animator.report.measurement import Measurement
from animator.report.record import FrameRow, RunRecord, Summary, summarize
from animator.scene import Scene
from exporters.atomic import replacing

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FinishedRun:
    """Everything a report is made from."""

    scene: Scene
    options: AnimateOptions
    plan: OutputPlan
    fit: Fit
    measurements: Sequence[Measurement]
    seconds: dict[str, float]
    """Wall time of the parts of the run [s]."""


def write_report(run: FinishedRun) -> Summary:
    """Write the contact sheet, the JSON and the HTML.

    Returns:
        The summary, which says whether the run passes the quality gate.

    Raises:
        WriteError: If one cannot be written.
    """
    record = run_record(run)
    pictures = [m.pictures for m in run.measurements if m.pictures is not None]
    rows = {row.number: row for row in record.rows}
    sheet = contact_sheet(pictures, [_caption(rows[picture.number]) for picture in pictures])
    png = png_bytes(sheet)
    contents = {
        run.plan.contact_sheet: png,
        run.plan.report_json: json_report(record).encode(),
        run.plan.report_html: html_report(record, png).encode(),
    }
    for path, content in contents.items():
        if path is not None:
            with replacing(path) as staged:
                staged.write_bytes(content)
    return record.summary


def run_record(run: FinishedRun) -> RunRecord:
    """Collect what a report says."""
    scene, fit = run.scene, run.fit
    height_px, width_px = scene.frames.images.shape[1:3]
    qualities = [measurement.quality for measurement in run.measurements]
    return RunRecord(
        name=fit.clip.name,
        inputs={
            "frames": len(scene.frames),
            "width_px": width_px,
            "height_px": height_px,
            "fps": scene.frames.fps,
            "gaussians": len(scene.gaussians),
            "sh_degree": fit.clip.splats.sh_degree,
            "capture_cameras": len(scene.capture_cameras),
            "joints": len(fit.clip.rig),
            "keys": len(fit.clip.tracks),
            "diagonal": scene.gaussians.diagonal,
        },
        choices=scene.notes,
        settings=settings_of(run.options),
        versions=package_versions(),
        outputs=tuple(path.name for path in run.plan.files),
        seconds=run.seconds,
        rows=tuple(_rows(run)),
        summary=summarize(qualities, min_iou=run.options.min_iou),
    )


def settings_of(options: AnimateOptions) -> dict[str, Any]:
    """Return every option as a TOML file would hold it, what the profile chose included."""
    values = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    choices = export_options(options)
    values |= {name: getattr(choices, name) for name in CHOICES}
    return {name.replace("_", "-"): _plain(value) for name, value in values.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value if value is None or isinstance(value, bool | int | float) else str(value)


def _rows(run: FinishedRun) -> list[FrameRow]:
    frames, between = run.scene.frames, run.options.inbetween
    return [
        FrameRow(
            number=frames.numbers[index],
            name=frames.names[index],
            time_s=index * (between + 1) / frames.fps,
            matches=solved.stats.matches,
            reprojection_px=solved.stats.reprojection_px,
            start=solved.stats.start,
            groups=solved.groups.count,
            quality=measurement.quality,
            seconds=solved.stats.seconds,
        )
        for index, (solved, measurement) in enumerate(
            zip(run.fit.solved, run.measurements, strict=True)
        )
    ]


def _caption(row: FrameRow) -> str:
    quality = row.quality
    psnr = "-" if math.isnan(quality.psnr_db) else f"{quality.psnr_db:.1f} dB"
    return (
        f"frame {row.number}   PSNR {psnr}   IoU {quality.silhouette_iou:.3f}   "
        f"{row.matches} matches   {row.groups} rigid groups"
    )
