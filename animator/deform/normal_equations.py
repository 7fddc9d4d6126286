"""Normal equations of residuals that each depend on a few anchors: a matrix in a narrow band.

Anchors that share a residual are neighbors, so with the anchors in a good order (reverse Cuthill-McKee) all of
J^T J lies near its diagonal, and a factorization costs a fifth of a dense one.
"""

import dataclasses
from collections.abc import Iterable

import numpy as np
from scipy.linalg import solveh_banded
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

from animator.jit.kernel import RELAXED, kernel

UNKNOWNS = 6
"""Of an anchor: a rotation vector [rad], then a translation [scene unit]."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Residuals:
    """Weighted residuals and their derivatives."""

    values: np.ndarray
    """Residuals r, R rows each, shape (E, R)."""
    jacobian: np.ndarray
    """Their derivatives J by the unknowns of K anchors, shape (E, R, K, 6)."""
    anchor_ids: np.ndarray
    """The anchors that they depend on, int64, shape (E, K)."""


class NormalEquations:
    """The sums of J^T J and J^T r over residuals, built term by term."""

    def __init__(self, count: int, anchor_ids: Iterable[np.ndarray]) -> None:
        """Find the order of the anchors; the sums are zero.

        Args:
            count: Number of anchors A.
            anchor_ids: Which anchors the residuals will depend on, each of shape (E, K).
        """
        self._order, reach = _narrow_order(count, anchor_ids)
        self._places = np.empty_like(self._order)
        self._places[self._order] = np.arange(count)
        # Lower band by columns: row j holds M[j, j], M[j + 1, j], ...
        self._band = np.zeros((UNKNOWNS * count, UNKNOWNS * (reach + 1)))
        self._gradient = np.zeros((count, UNKNOWNS))

    def clear(self) -> None:
        """Set both sums to zero."""
        self._band[:] = 0.0
        self._gradient[:] = 0.0

    def add(self, residuals: Residuals) -> None:
        """Add the products of some residuals."""
        places = self._places[residuals.anchor_ids]
        _add_products(
            residuals.jacobian, residuals.values, places, self._band, self._gradient.reshape(-1)
        )

    def add_diagonal(self, weights: np.ndarray, pulls: np.ndarray) -> None:
        """Add a diagonal matrix and a gradient, both by anchor, shape (A, 6)."""
        self._band[:, 0] += weights[self._order].ravel()
        self._gradient += pulls[self._order]

    def step(self, damping: float) -> np.ndarray:
        """Return the Levenberg-Marquardt step -(M + damping diag M)^-1 g, shape (A, 6)."""
        band = self._band.copy()
        band[:, 0] += damping * np.maximum(band[:, 0], 1e-12) + 1e-12
        solution = solveh_banded(
            band.T, -self._gradient.ravel(), lower=True, overwrite_ab=True, check_finite=False
        )
        return solution.reshape(-1, UNKNOWNS)[self._places]

    def matrix(self) -> np.ndarray:
        """Return J^T J in the anchors' own order, shape (6 A, 6 A)."""
        size, width = self._band.shape
        lower = np.zeros((size, size + width))
        columns = np.arange(size)
        for below in range(width):
            lower[columns, columns + below] = self._band[:, below]
        upper = np.triu(lower[:, :size])
        dense = upper + np.triu(upper, 1).T
        places = (UNKNOWNS * self._places[:, None] + np.arange(UNKNOWNS)).ravel()
        return dense[np.ix_(places, places)]


def _narrow_order(count: int, anchor_ids: Iterable[np.ndarray]) -> tuple[np.ndarray, int]:
    """Order anchors so that those that share a residual are near; return it and the farthest distance."""
    pairs = [np.zeros((0, 2), np.int64)]
    for ids in anchor_ids:
        kept = ids.shape[1]
        both = np.stack([ids.repeat(kept, axis=1), np.tile(ids, kept)], axis=-1)
        pairs.append(both.reshape(-1, 2))
    first, second = np.concatenate(pairs).T
    graph = coo_matrix((np.ones(len(first)), (first, second)), (count, count)).tocsr()
    order = reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64)
    places = np.empty_like(order)
    places[order] = np.arange(count)
    reach = int(np.abs(places[first] - places[second]).max(initial=0))
    return order, reach


@kernel(fastmath=RELAXED)
def _add_products(jacobian, values, places, band, gradient):
    """Add J^T J to a lower band by columns, and J^T r to the gradient."""
    for e in range(values.shape[0]):
        for k in range(places.shape[1]):
            row = UNKNOWNS * places[e, k]
            for r in range(values.shape[1]):
                value = values[e, r]
                for i in range(UNKNOWNS):
                    gradient[row + i] += jacobian[e, r, k, i] * value
            for m in range(places.shape[1]):
                column = UNKNOWNS * places[e, m]
                if column > row:
                    continue
                for j in range(UNKNOWNS):
                    for i in range(j if column == row else 0, UNKNOWNS):
                        product = 0.0
                        for r in range(values.shape[1]):
                            product += jacobian[e, r, k, i] * jacobian[e, r, m, j]
                        band[column + j, row - column + i - j] += product
