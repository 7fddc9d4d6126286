"""Boxes around Gaussians."""

import functools
from collections.abc import Sequence

import numpy as np

from exporters import posing, quaternions
from exporters.clip import Clip, Posed, Skin
from exporters.skinned_mesh import SkinnedMesh

EXTENT_SIGMAS = 3.0  # the support of USD's ParticleFieldKernelGaussianEllipsoidAPI

ROUNDING_MARGIN = 1e-5  # keeps rounding from dropping an ellipsoid that just reaches a side


def ellipsoid_half_widths(quats_wxyz: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Return half the widths of the tight boxes around 3-sigma ellipsoids, shape (N, 3).

    The half width of an ellipsoid with axes `R diag(s)` along a world axis is the norm of that row.

    Args:
        quats_wxyz: Rotations, shape (N, 4).
        scales: Standard deviations [scene unit], shape (N, 3).
    """
    axes = quaternions.to_matrices(quats_wxyz) * scales[:, None, :]
    return EXTENT_SIGMAS * np.sqrt(np.einsum("nij,nij->ni", axes, axes))


class Ellipsoids:
    """The 3-sigma ellipsoids of Gaussians, whose box is asked for again and again as they move.

    Only the ellipsoids that may reach a side are looked at: those whose largest radius passes every
    other's smallest one.
    """

    def __init__(self, scales: np.ndarray) -> None:
        """Prepare what does not change with the pose.

        Args:
            scales: Standard deviations [scene unit], shape (N, 3).
        """
        self._scales = scales
        self._inner = EXTENT_SIGMAS * functools.reduce(np.minimum, scales.T)
        self._outer = EXTENT_SIGMAS * functools.reduce(np.maximum, scales.T)
        self._outer *= 1 + ROUNDING_MARGIN

    def extent(self, posed: Posed) -> np.ndarray:
        """Return the tight box around all, rows min and max [scene unit], float32, shape (2, 3)."""
        may_reach = np.zeros(len(self._scales), dtype=bool)
        for coordinates in np.ascontiguousarray(posed.positions.T):  # numpy is slow on short rows
            may_reach |= coordinates - self._outer <= (coordinates - self._inner).min()
            may_reach |= coordinates + self._outer >= (coordinates + self._inner).max()
        few = np.flatnonzero(may_reach)
        positions = posed.positions[few]
        half_widths = ellipsoid_half_widths(posed.quats_wxyz[few], self._scales[few])
        return point_extent(np.concatenate([positions - half_widths, positions + half_widths]))


def point_extent(points: np.ndarray) -> np.ndarray:
    """Return the box around points, rows min and max, shape (2, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])


def diagonal(clip: Clip) -> float:
    """Return the diagonal of the box around the centers at rest [scene unit]."""
    return float(np.linalg.norm(np.ptp(clip.splats.positions, axis=0)))


def swept_extent(clip: Clip, meshes: Sequence[SkinnedMesh] = ()) -> np.ndarray:
    """Return a box that holds the 3-sigma ellipsoids and the meshes, skinned, at all keys.

    It need not pose the Gaussians: a skinned point is a mean of where its joints alone would take
    it, so it lies within the boxes of what each joint moves, taken along by the joint. The box is
    therefore wider than the tightest one.

    Returns:
        Rows min and max [scene unit], float32, shape (2, 3).
    """
    splats = clip.splats
    half_widths = ellipsoid_half_widths(splats.quats_wxyz, splats.scales)
    boxes = np.full((2, len(clip.rig), 3), [[[np.inf]], [[-np.inf]]])
    _widen(boxes, clip.skin, splats.positions - half_widths, splats.positions + half_widths)
    for mesh in meshes:
        _widen(boxes, mesh, mesh.positions, mesh.positions)
    is_used = np.isfinite(boxes).all(axis=(0, 2))
    low, high = boxes[:, is_used]
    inverse_bind = np.linalg.inv(clip.bind_matrices())
    tracks = clip.tracks
    matrices = posing.world_matrices(clip.rig, tracks.translations, tracks.quats_wxyz)
    affine = (matrices @ inverse_bind)[:, is_used, :3]
    # The box around a turned box: |A| takes its half widths to theirs (Arvo 1990).
    centers = np.einsum("tjxy,jy->tjx", affine[..., :3], (low + high) / 2) + affine[..., 3]
    half_widths = np.einsum("tjxy,jy->tjx", np.abs(affine[..., :3]), (high - low) / 2)
    corners = np.concatenate([centers - half_widths, centers + half_widths])
    return point_extent(corners.reshape(-1, 3)).astype(np.float32)


def _widen(
    boxes: np.ndarray, influences: Skin | SkinnedMesh, low: np.ndarray, high: np.ndarray
) -> None:
    """Let the rest box of each joint, (2, J, 3), hold what it moves: from `low` to `high`."""
    rows, columns = np.nonzero(influences.weights > 0)
    joint_ids = influences.joint_ids[rows, columns].astype(np.intp)
    for axis in range(3):  # without rows or casts `at` is ten times as fast
        np.minimum.at(boxes[0, :, axis], joint_ids, low[rows, axis].astype(np.float64))
        np.maximum.at(boxes[1, :, axis], joint_ids, high[rows, axis].astype(np.float64))
