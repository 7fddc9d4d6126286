"""Cut an object from a plain background: a smooth fit to the border, sharpened by GrabCut."""

import dataclasses

import numpy as np

_WORKING_SIDE_PX = 400
"""GrabCut needs seconds a megapixel; masks are found at this size and scaled up."""
_BORDER_SHARE = 0.04
"""Width of the border that is taken for background, relative to the shorter side."""
_FIT_ROUNDS = 10
_INLIER_SIGMAS = 3.0
_OBJECT_SIGMAS = 4.0
_MAX_FIT_SIGMA = 6.0
"""Lab distance; a larger scatter around the fit means that the background is not plain."""
_MIN_OBJECT_DISTANCE = 6.0
"""Lab distance; two to three are just visible side by side."""
_GRABCUT_ROUNDS = 3
_PLAUSIBLE_SHARES = (0.002, 0.8)
"""Share of the image an object may cover; outside of it the fit is not believed."""
_SPECK_SHARE = 0.02
"""Pieces smaller than this share of the largest one are dropped."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _BackgroundFit:
    distances: np.ndarray
    """Lab distance of each pixel from the fitted background, shape (H, W)."""
    sigma: float
    """Robust scatter of the border around the fit."""
    is_border: np.ndarray
    """Where the fit was made, shape (H, W)."""


def object_mask(rgb: np.ndarray) -> np.ndarray | None:
    """Find the object in front of a plain background, which may shade smoothly.

    A quadratic polynomial in x and y is fitted to the Lab colors of the image's border, robustly,
    because the object may touch it. What is far from the fit starts GrabCut (Rother et al. 2004).

    Args:
        rgb: sRGB, uint8, shape (H, W, 3).

    Returns:
        Coverage 0..255, uint8, shape (H, W); None if the background is not plain or nothing
        plausible stands in front of it.
    """
    import cv2

    height_px, width_px = rgb.shape[:2]
    scale = min(1.0, _WORKING_SIDE_PX / max(height_px, width_px))
    small_px = max(1, round(width_px * scale)), max(1, round(height_px * scale))
    small = cv2.resize(rgb, small_px, interpolation=cv2.INTER_AREA)
    if min(small.shape[:2]) < 8:
        return None
    fit = _fit_background(small)
    if fit.sigma > _MAX_FIT_SIGMA:
        return None
    is_object = _cut(small, fit)
    if is_object is None:
        return None
    coverage = is_object.astype(np.uint8) * 255
    return cv2.resize(coverage, (width_px, height_px), interpolation=cv2.INTER_LINEAR)


def _fit_background(rgb: np.ndarray) -> _BackgroundFit:
    import cv2

    lab = cv2.cvtColor(rgb.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    height_px, width_px = lab.shape[:2]
    width_of_border = max(2, round(_BORDER_SHARE * min(height_px, width_px)))
    is_border = np.ones((height_px, width_px), bool)
    is_border[width_of_border:-width_of_border, width_of_border:-width_of_border] = False

    y, x = np.meshgrid(np.linspace(-1, 1, height_px), np.linspace(-1, 1, width_px), indexing="ij")
    basis = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    border_basis, border_lab = basis[is_border], lab[is_border]
    # Start from the median color: a least-squares start would lean towards an object at the edge.
    residuals = np.linalg.norm(border_lab - np.median(border_lab, axis=0), axis=1)
    sigma = _scatter(residuals)
    for _ in range(_FIT_ROUNDS):
        is_inlier = residuals <= _INLIER_SIGMAS * sigma
        coefficients = np.linalg.lstsq(
            border_basis[is_inlier], border_lab[is_inlier].astype(np.float64), rcond=None
        )[0]
        residuals = np.linalg.norm(border_lab - border_basis @ coefficients, axis=1)
        sigma = _scatter(residuals)
    distances = np.linalg.norm(lab - basis @ coefficients, axis=-1)
    return _BackgroundFit(distances=distances, sigma=sigma, is_border=is_border)


def _scatter(residuals: np.ndarray) -> float:
    """Robust standard deviation; not below the rounding of 8-bit colors."""
    return max(1.4826 * float(np.median(residuals)), 0.5)


def _cut(rgb: np.ndarray, fit: _BackgroundFit) -> np.ndarray | None:
    import cv2

    threshold = max(_OBJECT_SIGMAS * fit.sigma, _MIN_OBJECT_DISTANCE)
    is_far = fit.distances > threshold
    if not _is_plausible(is_far):
        return None
    labels = np.where(is_far, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[fit.is_border & ~is_far] = cv2.GC_BGD
    # GrabCut clusters from OpenCV's own random state: reset it, so that the same image always
    # gives the same mask.
    cv2.setRNGSeed(0)
    background, foreground = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(
        np.ascontiguousarray(rgb),
        labels,
        (0, 0, 0, 0),  # not looked at: the labels say it all
        background,
        foreground,
        _GRABCUT_ROUNDS,
        cv2.GC_INIT_WITH_MASK,
    )
    is_object = _without_specks((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD))
    return is_object if _is_plausible(is_object) else None


def _is_plausible(is_object: np.ndarray) -> bool:
    smallest, largest = _PLAUSIBLE_SHARES
    return smallest <= float(is_object.mean()) <= largest


def _without_specks(is_object: np.ndarray) -> np.ndarray:
    import cv2

    _, labels, stats, _ = cv2.connectedComponentsWithStats(is_object.astype(np.uint8))
    areas = stats[:, cv2.CC_STAT_AREA].astype(np.int64)
    areas[0] = 0  # label 0 is the background
    is_kept = areas >= max(1.0, _SPECK_SHARE * float(areas.max()))
    return is_kept[np.asarray(labels, np.intp)]
