"""Figures of merit of one frame, each one pure function on arrays."""

import dataclasses
import math

import numpy as np

MAX_PSNR_DB = 100.0
"""Reported for identical images, whose PSNR is infinite."""
SOLID_ALPHA = 0.5
"""Coverage above which a pixel belongs to the silhouette."""
SEEN_SHARE = 0.1
"""A Gaussian counts as seen if at least this share of it reaches the camera.

Gaussians of one surface overlap and share the light: on three scenes this value agrees best (89 to
91 %) with lying in front of the rendered depth; 0.3 would call most of a visible surface unseen.
"""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Spread:
    """Many figures in two; NaN if there are none."""

    median: float = math.nan
    p95: float = math.nan
    """Only a twentieth of the figures is larger."""

    @classmethod
    def of(cls, figures: np.ndarray) -> "Spread":
        """Sum up figures of any shape."""
        if not figures.size:
            return cls()
        median, p95 = np.percentile(figures, [50, 95])
        return cls(median=float(median), p95=float(p95))


UNKNOWN = Spread()
"""Nothing was measured."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameQuality:
    """How well one solved frame explains its picture, and how honest the rig is about it."""

    psnr_db: float
    """PSNR inside the union of both silhouettes, on black [dB]; NaN if both are empty."""
    silhouette_iou: float
    """Overlap of the render's silhouette with the frame's, 0..1."""
    rigid_residual_percent: float
    """RMS distance of the rigid groups from a rigid motion [% of the diagonal]; NaN without."""
    skin_error_percent: float
    """Largest distance of a skinned Gaussian from its optimized place [% of the diagonal]."""
    unseen_share: float
    """Opacity-weighted share of the Gaussians that this frame does not show, 0..1."""
    never_seen_share: float
    """The same of those that no frame up to this one shows: their motion is a guess, 0..1."""
    uncertainty_along_percent: Spread = UNKNOWN
    """Standard deviations of the anchors along the viewing ray [% of the diagonal]."""
    uncertainty_across_percent: Spread = UNKNOWN
    """The same in a direction across it."""


def masked_psnr_db(first_rgb: np.ndarray, second_rgb: np.ndarray, mask: np.ndarray) -> float:
    """Return the PSNR of two images where the mask is True.

    Args:
        first_rgb: Colors 0..1, shape (H, W, 3).
        second_rgb: Colors 0..1, shape (H, W, 3).
        mask: Where to compare, bool, shape (H, W).

    Returns:
        -10 log10 of the mean squared difference, at most `MAX_PSNR_DB`; NaN for an empty mask.
    """
    if not mask.any():
        return float("nan")
    squared = np.square(first_rgb[mask].astype(np.float64) - second_rgb[mask])
    return float(min(-10.0 * np.log10(max(squared.mean(), 1e-30)), MAX_PSNR_DB))


def silhouette_iou(first_mask: np.ndarray, second_mask: np.ndarray) -> float:
    """Return intersection over union of two bool masks, shapes (H, W); 1 if both are empty."""
    union = np.count_nonzero(first_mask | second_mask)
    return np.count_nonzero(first_mask & second_mask) / union if union else 1.0


def rigid_residual(rest: np.ndarray, posed: np.ndarray, labels: np.ndarray) -> float:
    """Measure how far the rigid groups are from moving rigidly.

    Each group is fitted by its best rotation and translation (Kabsch 1976, with the sign fix of
    Umeyama 1991); what remains is averaged over the members of all groups.

    Args:
        rest: Centers at rest [scene unit], shape (N, 3).
        posed: Centers now [scene unit], shape (N, 3).
        labels: Group of each Gaussian, -1 for none, shape (N,).

    Returns:
        RMS distance [scene unit]; NaN if there is no group.
    """
    squared_sum, member_count = 0.0, 0
    for label in np.unique(labels[labels >= 0]):
        members = labels == label
        source = rest[members].astype(np.float64)
        target = posed[members].astype(np.float64)
        source -= source.mean(axis=0)
        target -= target.mean(axis=0)
        u, _, vt = np.linalg.svd(target.T @ source)
        flip = np.diag([1.0, 1.0, np.linalg.det(u @ vt)])
        squared_sum += float(np.square(target - source @ (u @ flip @ vt).T).sum())
        member_count += len(source)
    return float(np.sqrt(squared_sum / member_count)) if member_count else float("nan")


def largest_distance(first: np.ndarray, second: np.ndarray) -> float:
    """Return the largest distance between points of equal index, shapes (N, 3)."""
    difference = first.astype(np.float64) - second
    return float(np.sqrt(np.square(difference).sum(axis=1).max(initial=0.0)))


def weighted_share(is_counted: np.ndarray, weights: np.ndarray) -> float:
    """Return the share of the total weight that the counted ones hold, shapes (N,); 0 without."""
    total = float(weights.sum(dtype=np.float64))
    return float(weights[is_counted].sum(dtype=np.float64)) / total if total > 0 else 0.0
