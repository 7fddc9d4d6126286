"""The Gaussians as ellipsoids, in space or flattened onto a plane."""

import dataclasses

import numpy as np

from exporters import quaternions
from exporters.clip import Splats


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Ellipsoids:
    """N Gaussians in D dimensions, D = 3 in space, 2 seen along an axis."""

    centers: np.ndarray
    """Means [scene unit], float64, shape (N, D)."""
    covariances: np.ndarray
    """Covariances [scene unit squared], positive definite, float64, shape (N, D, D)."""
    opacities: np.ndarray
    """Peaks 0..1, float64, shape (N,)."""

    def __len__(self) -> int:
        return len(self.centers)

    def chosen(self, which: np.ndarray) -> "Ellipsoids":
        """Return some of them, by a mask or by indices."""
        return Ellipsoids(
            centers=self.centers[which],
            covariances=self.covariances[which],
            opacities=self.opacities[which],
        )

    def widened(self, sigma: float) -> "Ellipsoids":
        """Return them blurred by a ball of standard deviation `sigma` [scene unit].

        The peaks stay, so that a disk thinner than the cells of a grid is still met by some cell.
        """
        blur = sigma**2 * np.eye(self.centers.shape[1])
        return dataclasses.replace(self, covariances=self.covariances + blur)

    def seen_along(self, axis: int) -> "Ellipsoids":
        """Return their orthographic projections along a coordinate axis, in two dimensions.

        As a renderer of splats does, the peak stays the opacity (EWA splatting without the
        perspective).
        """
        kept = [other for other in range(self.centers.shape[1]) if other != axis]
        return dataclasses.replace(
            self,
            centers=self.centers[:, kept],
            covariances=self.covariances[:, kept][:, :, kept],
        )


def ellipsoids_of(splats: Splats) -> Ellipsoids:
    """Return the Gaussians at rest as ellipsoids, in double precision."""
    rotations = quaternions.to_matrices(splats.quats_wxyz.astype(np.float64))
    axes = rotations * splats.scales[:, None, :].astype(np.float64)
    return Ellipsoids(
        centers=splats.positions.astype(np.float64),
        covariances=axes @ axes.swapaxes(1, 2),
        opacities=splats.opacities.astype(np.float64),
    )
