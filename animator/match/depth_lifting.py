"""From a depth map to depths of Gaussians, on the scene's own scale.

A network says depth, or its inverse, up to a scale and an offset. So the map of a frame whose pose is known is laid on
the depths that the Gaussians have there, robustly.
"""

import dataclasses

import numpy as np

_ROUNDS = 10
"""Of reweighting; it converges in about five."""
_SPREAD = 1.5
"""Median residuals after which a residual counts half (Cauchy's norm)."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class DepthScale:
    """How to read a map: slope * value + offset is the depth, or its inverse."""

    slope: float
    offset: float
    is_inverse: bool
    """Near is large."""

    def depths(self, values: np.ndarray) -> np.ndarray:
        """Return depths [scene unit], NaN where the map says something behind the camera; any shape."""
        straight = self.slope * values + self.offset
        straight = np.where(straight > 0.0, straight, np.nan)
        return 1.0 / straight if self.is_inverse else straight

    def misfit(self, values: np.ndarray, depths: np.ndarray) -> float:
        """Return the median distance of a map from known depths [scene unit]."""
        return float(np.nanmedian(np.abs(self.depths(values) - depths)))


def lay_on(values: np.ndarray, depths: np.ndarray, *, is_inverse: bool) -> DepthScale | None:
    """Bring the values of a map to the scale of known depths, by the scale and offset that most agree on.

    Args:
        values: Of the map, finite, shape (M,).
        depths: Depths that are about right [scene unit], > 0, shape (M,).
        is_inverse: The map says inverse depth, so scale and offset belong to that.

    Returns:
        The scale; None where the map is flat, says nearer what is farther, or what is behind the camera.
    """
    known = 1.0 / depths if is_inverse else depths
    columns = np.stack([values, np.ones_like(values)], axis=1)
    weights = np.ones(len(values))
    slope = offset = 0.0
    for _ in range(_ROUNDS):
        roots = np.sqrt(weights)
        slope, offset = np.linalg.lstsq(columns * roots[:, None], known * roots)[0]
        residuals = np.abs(slope * values + offset - known)
        spread = max(_SPREAD * float(np.median(residuals)), 1e-12)
        weights = 1.0 / (1.0 + (residuals / spread) ** 2)
    is_flat = slope * np.ptp(values) < 1e-9 * np.abs(known).max()
    if is_flat or (slope * values + offset <= 0.0).any():
        return None
    return DepthScale(slope=float(slope), offset=float(offset), is_inverse=is_inverse)
