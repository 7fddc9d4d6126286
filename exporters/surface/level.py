"""How dense is solid: the level at which the surface is cut, found by comparing silhouettes."""

import numpy as np

from exporters.surface.ellipsoids import Ellipsoids
from exporters.surface.grid import Grid

SILHOUETTE_ABSORPTION = np.log(2.0)
"""-log(1 - 0.5): what half covers the background belongs to the silhouette."""

_CANDIDATES = np.geomspace(0.05, 2.0, 38)
"""Levels tried, each a tenth above the last."""

_PIXEL_SIGMA = 0.3
"""Blur of the drawn silhouettes [cells], so that no Gaussian falls between the pixels."""


def matching_level(field: np.ndarray, ellipsoids: Ellipsoids, grid: Grid) -> float:
    """Return the level whose silhouettes agree best with those of the drawn Gaussians.

    A splat is as opaque as the layers along a line of sight, so the density of its surface differs:
    one layer of solid Gaussians, or many of faint ones. Hence the Gaussians are drawn along the
    three axes, and the level is chosen by the mean of the intersections over unions.

    Args:
        field: Absorption in the cells.
        ellipsoids: The Gaussians that made it.
        grid: The cells.
    """
    agreement = np.zeros(len(_CANDIDATES))
    for axis in range(3):
        flat = ellipsoids.seen_along(axis).widened(_PIXEL_SIGMA * grid.pitch)
        truth = grid.seen_along(axis).absorption(flat) >= SILHOUETTE_ABSORPTION
        densest = field.max(axis=axis)
        shapes = densest >= _CANDIDATES[:, None, None]
        common = (shapes & truth).sum(axis=(1, 2))
        either = (shapes | truth).sum(axis=(1, 2))
        agreement += common / np.maximum(either, 1)
    return float(_CANDIDATES[np.argmax(agreement)])
