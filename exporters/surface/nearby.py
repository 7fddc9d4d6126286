"""What the Gaussians near a point of the surface give it: color and skin."""

import dataclasses

import numpy as np

from exporters.skinned_mesh import INFLUENCES
from exporters.surface.ellipsoids import Ellipsoids

_NEIGHBORS = 32
_REACH_SIGMAS = 3.0
_POINTS_AT_ONCE = 20_000  # some 30 numbers for each of their neighbors: 150 MB


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Nearby:
    """The Gaussians that an observer sees when looking straight at points of a surface."""

    splat_ids: np.ndarray
    """Gaussians near each point, int64, shape (V, K)."""
    shares: np.ndarray
    """How much of the point's color each is, rows sum to 1, float64, shape (V, K)."""

    def blend(self, per_splat: np.ndarray) -> np.ndarray:
        """Return the mean of a property, (N, D) to (V, D)."""
        return np.einsum("vk,vkd->vd", self.shares, per_splat[self.splat_ids])

    def blended_skin(
        self, joint_ids: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean of the skin: the strongest four joints of each point, none twice.

        Args:
            joint_ids: Joints of the N Gaussians, shape (N, 4).
            weights: Their weights, shape (N, 4).

        Returns:
            Joints and weights, which need not sum to 1, both of shape (V, 4).
        """
        point_count = len(self.splat_ids)
        joint_ids = joint_ids[self.splat_ids].reshape(point_count, -1)
        weights = self.shares[:, :, None] * weights[self.splat_ids]
        weights = weights.reshape(point_count, -1)
        # Sorted by joint, a joint's weight is what the running sum gains over its run.
        order = np.argsort(joint_ids, axis=1, kind="stable")
        joint_ids = np.take_along_axis(joint_ids, order, axis=1)
        sums = np.cumsum(np.take_along_axis(weights, order, axis=1), axis=1)
        ends_run = np.ones(joint_ids.shape, bool)
        ends_run[:, :-1] = joint_ids[:, 1:] != joint_ids[:, :-1]
        before = np.maximum.accumulate(np.where(ends_run, sums, 0), axis=1)
        before = np.concatenate([np.zeros((point_count, 1)), before[:, :-1]], axis=1)
        totals = np.where(ends_run, sums - before, 0)
        strongest = np.argsort(-totals, axis=1, kind="stable")[:, :INFLUENCES]
        return (
            np.take_along_axis(joint_ids, strongest, axis=1),
            np.take_along_axis(totals, strongest, axis=1),
        )


def look_at(
    points: np.ndarray, normals: np.ndarray, ellipsoids: Ellipsoids, reach: float
) -> Nearby:
    """Blend the Gaussians in front of and behind each point, seen against its normal.

    Each has, on the line of sight, the alpha of its densest place there; they cover one another in
    the order of these places, front to back. So what is hidden below the surface, where trained
    models keep whatever no camera saw, gives nothing.

    Args:
        points: Places on the surface [scene unit], shape (V, 3).
        normals: Unit vectors outward, shape (V, 3).
        ellipsoids: N Gaussians.
        reach: What lies farther above or below than this and three sigmas is of another part
            [scene unit].
    """
    from scipy.spatial import KDTree

    tree = KDTree(ellipsoids.centers)
    precisions = np.linalg.inv(ellipsoids.covariances)
    count = min(_NEIGHBORS, len(ellipsoids))
    ids, shares = [], []
    for start in range(0, len(points), _POINTS_AT_ONCE):
        chunk = slice(start, start + _POINTS_AT_ONCE)
        _, nearest = tree.query(points[chunk], k=count)
        nearest = nearest.reshape(-1, count)
        offsets = points[chunk, None, :] - ellipsoids.centers[nearest]
        bent = np.einsum("vkij,vkj->vki", precisions[nearest], offsets)
        along = np.einsum("vki,vi->vk", bent, normals[chunk])
        bent_normals = np.einsum("vkij,vj->vki", precisions[nearest], normals[chunk])
        curvature = np.einsum("vki,vi->vk", bent_normals, normals[chunk])
        heights = -along / curvature
        distances = np.einsum("vki,vki->vk", bent, offsets) - along**2 / curvature
        alphas = ellipsoids.opacities[nearest] * np.exp(-0.5 * distances)
        alphas[np.abs(heights) > reach + _REACH_SIGMAS / np.sqrt(curvature)] = 0
        ids.append(nearest)
        shares.append(_front_to_back(alphas, heights))
    return Nearby(splat_ids=np.concatenate(ids), shares=np.concatenate(shares))


def _front_to_back(alphas: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return what each layer adds to the picture; all to the first where none is near enough."""
    order = np.argsort(-heights, axis=1, kind="stable")
    ordered = np.take_along_axis(alphas, order, axis=1)
    passed = np.cumprod(1 - ordered, axis=1)
    passed = np.concatenate([np.ones((len(alphas), 1)), passed[:, :-1]], axis=1)
    shares = np.zeros_like(alphas)
    np.put_along_axis(shares, order, ordered * passed, axis=1)
    sums = shares.sum(axis=1, keepdims=True)
    lonely = sums[:, 0] < 1e-6
    shares[lonely, 0], sums[lonely] = 1, 1  # the nearest, as the tree has sorted them
    return shares / np.maximum(sums, 1e-6)
