"""Which way the object's surface faces at each Gaussian."""

import dataclasses

import numpy as np
from scipy.spatial import KDTree

_NEIGHBORS = 24
_FLAT = 0.05
"""Share of the neighborhood's variance across the surface, up to which it is one."""
_ROUND = 0.15
"""... from which it is none, but a lump."""
_CHUNK = 65_536
"""Gaussians whose neighbors are looked up at a time, to save memory."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceNormals:
    """Normals of N Gaussians at rest."""

    directions: np.ndarray
    """Unit normals; which of the two sides they point to says nothing, shape (N, 3)."""
    trusts: np.ndarray
    """1 where the neighborhood is flat, 0 where it is round, shape (N,)."""


def surface_normals(means: np.ndarray) -> SurfaceNormals:
    """Estimate normals by the principal axes of each Gaussian's neighborhood (Hoppe et al. 1992).

    Not by the Gaussian's own shortest axis: splats are trained to draw well, and many stand askew.

    Args:
        means: Rest centres [scene unit], shape (N, 3).

    Returns:
        A normal and the trust in it for each; no trust in any where there are fewer than four.
    """
    points = np.asarray(means, np.float64)
    count = min(_NEIGHBORS, len(points))
    if count < 4:
        upward = np.tile([0.0, 1.0, 0.0], (len(points), 1))
        return SurfaceNormals(directions=upward, trusts=np.zeros(len(points)))
    tree = KDTree(points)
    parts = [points[start : start + _CHUNK] for start in range(0, len(points), _CHUNK)]
    found = [_principal_axes(points[tree.query(part, k=count)[1]]) for part in parts]
    across = np.concatenate([shares for _, shares in found])
    return SurfaceNormals(
        directions=np.concatenate([directions for directions, _ in found]),
        trusts=np.clip((_ROUND - across) / (_ROUND - _FLAT), 0.0, 1.0),
    )


def _principal_axes(neighborhoods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the axis of least variance of M sets of points, shape (M, 3), and its share of the variance, (M,)."""
    arms = neighborhoods - neighborhoods.mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", arms, arms))
    return axes[:, :, 0], variances[:, 0] / np.maximum(variances.sum(axis=1), 1e-30)
