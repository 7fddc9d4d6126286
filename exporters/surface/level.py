"""How dense is solid: the level at which the surface is cut, found by comparing silhouettes."""

import numpy as np

from exporters.surface.ellipsoids import Ellipsoids
from exporters.surface.grid import Grid

SILHOUETTE_ABSORPTION = np.log(2.0)
"""-log(1 - 0.5): what half covers the background belongs to the silhouette."""

_DRAWN_FAINTEST = 1 / 255
"""Alpha below which renderers of splats leave a Gaussian out."""

_HIGHEST, _LOWEST = 2.0, 0.05
_CANDIDATE_COUNT = 38  # each a tenth above the last

_TIE = 0.004
"""Agreements that differ by less are equal; the lower level then has fewer pits and holes."""

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
    # A model of nothing but faint Gaussians has a silhouette too: where it is half its most opaque.
    highest = min(_HIGHEST, 0.9 * float(field.max()))
    candidates = np.geomspace(highest * _LOWEST / _HIGHEST, highest, _CANDIDATE_COUNT)
    agreement = np.zeros(len(candidates))
    for axis in range(3):
        flat = ellipsoids.seen_along(axis).widened(_PIXEL_SIGMA * grid.pitch)
        drawn = grid.seen_along(axis).absorption(flat, _DRAWN_FAINTEST)
        truth = drawn >= min(SILHOUETTE_ABSORPTION, 0.5 * float(drawn.max()))
        densest = field.max(axis=axis)
        for index, candidate in enumerate(candidates):
            shape = densest >= candidate
            agreement[index] += np.sum(shape & truth) / np.sum(shape | truth) / 3
    return float(candidates[np.argmax(agreement >= agreement.max() - _TIE)])
