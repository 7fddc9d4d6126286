"""How alike a drawn picture and a true one are."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from animator.evaluation.perceptual import Judge
from animator.report.quality import SOLID_ALPHA, masked_psnr_db, silhouette_iou

_FAINT_ALPHA = 0.05
"""Coverage of the drawing above which a pixel counts in the masked PSNR."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """A picture on black."""

    rgb: np.ndarray
    """Color times coverage, sRGB 0..1, float32, shape (H, W, 3)."""
    alpha: np.ndarray
    """Coverage 0..1, float32, shape (H, W)."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImageScores:
    """One picture, or the mean of several."""

    psnr_db: float
    """Inside the union of both silhouettes [dB]."""
    psnr_full_db: float
    """Over the whole picture [dB]."""
    ssim: float
    """Structural similarity (Wang et al. 2004) over the whole picture, window 11, sigma 1.5."""
    iou: float
    """Overlap of the silhouettes."""
    flip: float
    """Mean LDR-FLIP (Andersson et al. 2020) over the whole picture; NaN without its package."""
    lpips: float
    """LPIPS (Zhang et al. 2018) over the whole picture; NaN without its weights."""


def score_picture(drawn: Picture, true: Picture, judges: Mapping[str, Judge]) -> ImageScores:
    """Compare one picture with the true one of the same size.

    Args:
        drawn: The result.
        true: The truth.
        judges: Perceptual measures by the name of their field; those that are missing are NaN.
    """
    everywhere = np.ones(true.alpha.shape, bool)
    union = (true.alpha > 0) | (drawn.alpha > _FAINT_ALPHA)
    scores = {name: judge(drawn.rgb, true.rgb) for name, judge in judges.items()}
    return ImageScores(
        psnr_db=masked_psnr_db(drawn.rgb, true.rgb, union),
        psnr_full_db=masked_psnr_db(drawn.rgb, true.rgb, everywhere),
        ssim=structural_similarity(drawn.rgb, true.rgb),
        iou=silhouette_iou(true.alpha > SOLID_ALPHA, drawn.alpha > SOLID_ALPHA),
        flip=scores.get("flip", float("nan")),
        lpips=scores.get("lpips", float("nan")),
    )


def structural_similarity(first: np.ndarray, second: np.ndarray) -> float:
    """Return the mean SSIM of two pictures 0..1, shapes (H, W, 3), the border included."""
    from skimage import metrics

    result = metrics.structural_similarity(
        first,
        second,
        data_range=1.0,
        channel_axis=2,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        full=True,
    )
    return float(np.mean(result[1], dtype=np.float64))


def mean_scores(scores: Sequence[ImageScores]) -> ImageScores:
    """Average each figure over the pictures in which it could be measured; NaN if in none."""
    means = {}
    for field in dataclasses.fields(ImageScores):
        values = np.array([getattr(score, field.name) for score in scores], np.float64)
        finite = values[np.isfinite(values)]
        means[field.name] = float(finite.mean()) if finite.size else float("nan")
    return ImageScores(**means)
