"""Points that ride on Gaussians: those of a surface on the ones around them."""

import dataclasses

import numpy as np
from scipy.spatial import KDTree

from animator.types import Gaussians

CARRIERS = 4
"""Gaussians that carry a point of the surface."""
SOLID_OPACITY = 0.3
"""Fainter Gaussians are not taken for the surface."""
_SOFTENING = 1e-4
"""Added to distances [diagonals], so that a point on a Gaussian has a finite weight."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class CarriedPoints:
    """P points, each bound to some of N Gaussians."""

    rest: np.ndarray
    """Points at rest [scene unit], float64, shape (P, 3)."""
    gaussian_rest: np.ndarray
    """Gaussians at rest [scene unit], float64, shape (N, 3)."""
    gaussian_ids: np.ndarray
    """Carriers of each point, shape (P, k)."""
    weights: np.ndarray
    """Their shares, rows sum to 1, shape (P, k)."""

    @classmethod
    def on_surface(
        cls, points: np.ndarray, gaussians: Gaussians, *, diagonal: float
    ) -> "CarriedPoints":
        """Bind points to their nearest Gaussians at rest, by the inverse of the distance.

        Args:
            points: At rest [scene unit], shape (P, 3).
            gaussians: At rest; faint ones carry nothing, unless there are too few others.
            diagonal: Of the object [scene unit].
        """
        centers = gaussians.means.detach().cpu().numpy().astype(np.float64)
        solid = np.flatnonzero(gaussians.opacities.detach().cpu().numpy() > SOLID_OPACITY)
        if len(solid) < CARRIERS:
            solid = np.arange(len(centers))
        count = min(CARRIERS, len(solid))
        distances, nearest = KDTree(centers[solid]).query(points, k=count)
        # For one neighbor alone, the tree returns arrays without a second axis.
        shape = (len(points), count)
        weights = 1.0 / (np.reshape(distances, shape) + _SOFTENING * diagonal)
        return cls(
            rest=points,
            gaussian_rest=centers,
            gaussian_ids=solid[np.reshape(nearest, shape)],
            weights=weights / weights.sum(axis=1, keepdims=True),
        )

    @classmethod
    def on_centers(cls, gaussian_ids: np.ndarray, gaussians: Gaussians) -> "CarriedPoints":
        """Take the centers of some Gaussians themselves."""
        centers = gaussians.means.detach().cpu().numpy().astype(np.float64)
        return cls(
            rest=centers[gaussian_ids],
            gaussian_rest=centers,
            gaussian_ids=gaussian_ids[:, None],
            weights=np.ones((len(gaussian_ids), 1)),
        )

    def at(self, positions: np.ndarray) -> np.ndarray:
        """Return where the points are when the Gaussians are at positions of shape (N, 3)."""
        return self.rest + self.average(positions.astype(np.float64) - self.gaussian_rest)

    def average(self, values: np.ndarray) -> np.ndarray:
        """Average a quantity of the Gaussians, shape (N, ...), for each point, shape (P, ...)."""
        return np.einsum("pk,pk...->p...", self.weights, values[self.gaussian_ids])
