"""What a report says, before it is written in any format."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from animator.report.quality import FrameQuality


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameRow:
    """One frame of the report."""

    number: int
    """The original frame number."""
    name: str
    """Its file name."""
    time_s: float
    """When it is shown [s]."""
    matches: int
    """Gaussian-to-pixel matches used."""
    reprojection_px: float
    """Median reprojection error of the matches [px]; NaN without."""
    start: str
    """Which candidate started the optimization."""
    groups: int
    """Rigid groups."""
    quality: FrameQuality
    seconds: Mapping[str, float]
    """Wall time a stage [s]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Summary:
    """The whole clip in a few numbers."""

    frames: int
    mean_psnr_db: float
    mean_silhouette_iou: float
    lowest_silhouette_iou: float
    largest_skin_error_percent: float
    never_seen_share: float
    """After the last frame."""
    min_iou: float
    """The quality gate."""
    is_good: bool
    """Whether the mean silhouette IoU reaches the gate."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunRecord:
    """Everything a report shows."""

    name: str
    """Name of the asset."""
    inputs: Mapping[str, Any]
    """Counts and sizes of what was read."""
    choices: tuple[str, ...]
    """What was found and chosen, and why; one sentence each."""
    settings: Mapping[str, Any]
    """Every option, as the user could type it."""
    versions: Mapping[str, str]
    """Of the program and of the packages that matter."""
    outputs: tuple[str, ...]
    """Names of the files written."""
    seconds: Mapping[str, float]
    """Wall time of the parts of the run [s]."""
    rows: tuple[FrameRow, ...]
    summary: Summary


def summarize(qualities: Sequence[FrameQuality], *, min_iou: float) -> Summary:
    """Boil the frames down.

    Args:
        qualities: At least one.
        min_iou: Mean silhouette IoU below which the run has failed.
    """
    ious = [quality.silhouette_iou for quality in qualities]
    mean_iou = _mean(ious)
    return Summary(
        frames=len(qualities),
        mean_psnr_db=_mean([quality.psnr_db for quality in qualities]),
        mean_silhouette_iou=mean_iou,
        lowest_silhouette_iou=min(ious),
        largest_skin_error_percent=max(quality.skin_error_percent for quality in qualities),
        never_seen_share=qualities[-1].never_seen_share,
        min_iou=min_iou,
        is_good=mean_iou >= min_iou,
    )


def _mean(values: Sequence[float]) -> float:
    """Average what can be measured; NaN if nothing can."""
    finite = [value for value in values if math.isfinite(value)]
    return math.fsum(finite) / len(finite) if finite else math.nan
