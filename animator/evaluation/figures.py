"""The figures of a row, by name: one list for Markdown, JSON and means."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from animator.evaluation.benchmark import Row


@dataclasses.dataclass(frozen=True, kw_only=True)
class Figure:
    """One column."""

    title: str
    """Head of the column."""
    digits: int
    """After the point."""
    of: Callable[[Row], float]


FIGURES: dict[str, Figure] = {
    "captured": Figure(title="captured", digits=3, of=lambda r: r.scores.motion.all.captured),
    "captured_seen": Figure(title="seen", digits=3, of=lambda r: r.scores.motion.seen.captured),
    "captured_unseen": Figure(
        title="unseen", digits=3, of=lambda r: r.scores.motion.unseen.captured
    ),
    "epe_percent": Figure(title="error %", digits=2, of=lambda r: r.scores.motion.all.epe_percent),
    "lateral_percent": Figure(
        title="lateral %", digits=2, of=lambda r: r.scores.motion.all.lateral_percent
    ),
    "depth_percent": Figure(
        title="depth %", digits=2, of=lambda r: r.scores.motion.all.depth_percent
    ),
    "rigid_error_percent": Figure(
        title="bent %", digits=3, of=lambda r: r.scores.motion.rigid_error_percent
    ),
    "jitter": Figure(title="jitter", digits=2, of=lambda r: r.scores.motion.jitter),
    "psnr_db": Figure(title="PSNR", digits=2, of=lambda r: r.scores.held_out.psnr_db),
    "psnr_full_db": Figure(
        title="PSNR full", digits=2, of=lambda r: r.scores.held_out.psnr_full_db
    ),
    "ssim": Figure(title="SSIM", digits=3, of=lambda r: r.scores.held_out.ssim),
    "flip": Figure(title="FLIP", digits=3, of=lambda r: r.scores.held_out.flip),
    "lpips": Figure(title="LPIPS", digits=3, of=lambda r: r.scores.held_out.lpips),
    "iou": Figure(title="IoU", digits=3, of=lambda r: r.scores.held_out.iou),
    "front_psnr_db": Figure(title="front PSNR", digits=2, of=lambda r: r.scores.front.psnr_db),
    "front_iou": Figure(title="front IoU", digits=3, of=lambda r: r.scores.front.iou),
    "uncertainty_depth": Figure(title="rank depth", digits=2, of=lambda r: r.uncertainty.depth),
    "uncertainty_lateral": Figure(
        title="rank lateral", digits=2, of=lambda r: r.uncertainty.lateral
    ),
    "seconds_per_frame": Figure(title="s/frame", digits=1, of=lambda r: r.seconds_per_frame),
}
"""By key in JSON, in the order of the columns."""


def figures_of(row: Row) -> dict[str, float]:
    """Return all figures of a row."""
    return {key: float(figure.of(row)) for key, figure in FIGURES.items()}


def mean_figures(rows: Sequence[Row]) -> dict[str, float]:
    """Average each figure over the rows in which it could be measured; NaN if in none."""
    means = {}
    for key, figure in FIGURES.items():
        values = np.array([figure.of(row) for row in rows], np.float64)
        finite = values[np.isfinite(values)]
        means[key] = float(finite.mean()) if finite.size else float("nan")
    return means


def by_method(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Sort rows by method, methods in the order in which they come."""
    sorted_rows: dict[str, list[Row]] = {}
    for row in rows:
        sorted_rows.setdefault(row.method, []).append(row)
    return sorted_rows
