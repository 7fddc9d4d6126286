"""Cells of one size in space or in a plane, and Gaussians summed up in them."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from exporters.surface.ellipsoids import Ellipsoids

MOST_OPAQUE = 0.99
"""Alpha is held below 1, as renderers of splats do: nothing is absorbed without end."""

_CELLS_AT_ONCE = 1_000_000  # some 20 arrays of that many numbers: 100 MB


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Grid:
    """Points on a regular lattice in D dimensions."""

    origin: np.ndarray
    """Place of point 0, 0, ... [scene unit], float64, shape (D,)."""
    pitch: float
    """Distance of neighboring points [scene unit]."""
    shape: tuple[int, ...]
    """Points along each axis, length D."""

    def seen_along(self, axis: int) -> "Grid":
        """Return the grid without one axis."""
        return Grid(
            origin=np.delete(self.origin, axis),
            pitch=self.pitch,
            shape=tuple(size for other, size in enumerate(self.shape) if other != axis),
        )

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the indices of the lattice points nearest to places, D arrays of shape (M,)."""
        indices = np.rint((points - self.origin) / self.pitch).astype(np.int64)
        return tuple(np.clip(indices, 0, np.array(self.shape) - 1).T)

    def absorption(self, ellipsoids: Ellipsoids, faintest: float) -> np.ndarray:
        """Return the sum of -log(1 - alpha) over all Gaussians, float32, of the grid's shape.

        1 - exp(-absorption) is the alpha of all of them together, in whatever order, as if all
        stood at one depth.

        Args:
            ellipsoids: In as many dimensions as the grid has.
            faintest: A Gaussian is left out where its alpha is below this.
        """
        absorption = np.zeros(self.shape, np.float32).reshape(-1)
        for cells, values in self._contributions(ellipsoids, faintest):
            np.add.at(absorption, cells, values)
        return absorption.reshape(self.shape)

    def _contributions(
        self, ellipsoids: Ellipsoids, faintest: float
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield flat cell indices and absorptions, a bounded number at once.

        Each Gaussian is cut into lines of cells along the last axis, on which it is a Gaussian of
        one dimension: so only cells that it reaches are visited, and each costs one exponential.
        """
        centers = (ellipsoids.centers - self.origin) / self.pitch
        covariances = ellipsoids.covariances / self.pitch**2
        precisions = np.linalg.inv(covariances)
        reach_squared = 2 * np.log(np.maximum(ellipsoids.opacities / faintest, 1.0))
        half_widths = np.sqrt(reach_squared[:, None] * np.einsum("nii->ni", covariances))
        first, counts = self._spans(centers - half_widths, centers + half_widths)
        for chunk in _chunks(counts.prod(axis=1)):
            owners, across = _cells_of_boxes(first[chunk, :-1], counts[chunk, :-1])
            owners += chunk.start
            offsets = across - centers[owners, :-1]
            curvature = precisions[owners, -1, -1]
            slope = np.einsum("ma,ma->m", offsets, precisions[owners, :-1, -1])
            turned = np.einsum("mab,mb->ma", precisions[owners, :-1, :-1], offsets)
            distances = np.einsum("ma,ma->m", offsets, turned) - slope**2 / curvature
            room = reach_squared[owners] - distances
            is_met = room > 0
            owners, across, curvature = owners[is_met], across[is_met], curvature[is_met]
            middles = centers[owners, -1] - slope[is_met] / curvature
            halves = np.sqrt(room[is_met] / curvature)
            low, steps = self._spans(middles - halves, middles + halves, axis=-1)
            lines, along = _cells_of_boxes(low[:, None], steps[:, None])
            peaks = ellipsoids.opacities[owners] * np.exp(-0.5 * distances[is_met])
            rows = np.asarray(np.ravel_multi_index(tuple(across.T), self.shape[:-1]))
            rows = rows * self.shape[-1]
            from_middle = along[:, 0] - middles[lines]
            alphas = peaks[lines] * np.exp(-0.5 * curvature[lines] * from_middle**2)
            absorptions = -np.log1p(-np.minimum(alphas, MOST_OPAQUE))
            # Of the type of the sum, since numpy adds unlike types far more slowly.
            yield rows[lines] + along[:, 0], absorptions.astype(np.float32)

    def _spans(
        self, low: np.ndarray, high: np.ndarray, axis: int | slice = slice(None)
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the first lattice index and the number of them from `low` to `high`."""
        first = np.maximum(np.ceil(low), 0).astype(np.int64)
        last = np.minimum(np.floor(high), np.array(self.shape)[axis] - 1).astype(np.int64)
        return first, np.maximum(last - first + 1, 0)


def _chunks(counts: np.ndarray) -> Iterator[slice]:
    """Yield runs of boxes that together cover `_CELLS_AT_ONCE` cells, or one that alone does."""
    ends = np.cumsum(counts)
    start = 0
    while start < len(counts):
        limit = _CELLS_AT_ONCE + (ends[start - 1] if start else 0)
        stop = max(start + 1, int(np.searchsorted(ends, limit)))
        yield slice(start, stop)
        start = stop


def _cells_of_boxes(first: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List the cells of boxes.

    Args:
        first: Lowest cell of each box, shape (B, D).
        counts: Cells along each axis, shape (B, D).

    Returns:
        For each cell its box, shape (M,), and its indices, shape (M, D).
    """
    volumes = counts.prod(axis=1)
    owners = np.repeat(np.arange(len(volumes)), volumes)
    rest = np.arange(len(owners)) - np.repeat(np.cumsum(volumes) - volumes, volumes)
    indices = first[owners]
    for axis in reversed(range(1, counts.shape[1])):
        rest, steps = np.divmod(rest, counts[owners, axis])
        indices[:, axis] += steps
    indices[:, 0] += rest
    return owners, indices
