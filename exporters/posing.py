"""From joint transforms to posed Gaussians: the forward kinematics and the skin."""

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from exporters import quaternions
from exporters.clip import Posed, Rig, Skin, Splats

if TYPE_CHECKING:
    from scipy.sparse import csr_array

BLOCK_ROWS = 8192
"""Gaussians posed at a time: few enough for the processor's cache, which halves the time."""


def world_matrices(rig: Rig, translations: np.ndarray, quats_wxyz: np.ndarray) -> np.ndarray:
    """Compose parent-local transforms down the tree.

    Args:
        rig: The tree; parents come before children.
        translations: Parent-local translations [scene unit], shape (..., J, 3).
        quats_wxyz: Parent-local unit rotations, shape (..., J, 4).

    Returns:
        World-from-joint for column vectors, float64, shape (..., J, 4, 4).
    """
    matrices = local_matrices(translations, quats_wxyz)
    for joint, parent in enumerate(rig.parents):
        if parent >= 0:
            matrices[..., joint, :, :] = matrices[..., parent, :, :] @ matrices[..., joint, :, :]
    return matrices


def local_matrices(translations: np.ndarray, quats_wxyz: np.ndarray) -> np.ndarray:
    """Return parent-from-joint for column vectors, float64, shape (..., J, 4, 4)."""
    matrices = np.zeros((*translations.shape[:-1], 4, 4))
    matrices[..., :3, :3] = quaternions.to_matrices(quats_wxyz)
    matrices[..., :3, 3] = translations
    matrices[..., 3, 3] = 1.0
    return matrices


class Poser:
    """A rest pose and its skin, made ready to be posed many times.

    Centers: linear blend skinning. Rotations: the joints' rest-to-posed rotations, each with the
    sign nearest to that of the first influence of positive weight, summed by weight, multiplied on
    the left of the rest rotation, and normalized. Where opposite rotations cancel exactly the
    result is the identity.

    The sums are products of a sparse matrix, and what follows works on whole columns: numpy is slow
    on rows of three or four numbers.
    """

    def __init__(self, splats: Splats, skin: Skin, bind_matrices: np.ndarray) -> None:
        """Prepare all that does not change with the pose.

        Args:
            splats: The rest pose of N Gaussians.
            skin: Joints and weights of each.
            bind_matrices: World-from-joint at rest, shape (J, 4, 4).
        """
        self._joint_from_world = np.linalg.inv(bind_matrices)
        self._blocks = list(_blocks(splats, skin, len(bind_matrices)))
        self._count = len(splats)

    def pose(self, joint_matrices: np.ndarray) -> Posed:
        """Move the Gaussians with their joints.

        Args:
            joint_matrices: World-from-joint, rigid, float64, shape (J, 4, 4).
        """
        moves = (joint_matrices @ self._joint_from_world)[:, :3]
        turns_wxyz = quaternions.from_matrices(moves[:, :, :3])
        signs = np.where(turns_wxyz @ turns_wxyz.T < 0, -1, 1).astype(np.float32)
        of_joints = np.hstack([moves.reshape(-1, 12), turns_wxyz]).astype(np.float32)
        positions = np.empty((self._count, 3), np.float32)
        quats_wxyz = np.empty((self._count, 4), np.float32)
        for block in self._blocks:
            block.pose(of_joints, signs, positions[block.rows], quats_wxyz[block.rows])
        return Posed(positions=positions, quats_wxyz=quats_wxyz)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Block:
    """Some Gaussians next to each other."""

    rows: slice
    joint_ids: np.ndarray
    """Shape (B, 4)."""
    weights: np.ndarray
    """Rows sum to 1, float32, shape (B, 4)."""
    weight_matrix: "csr_array"
    """The same, shape (B, J)."""
    rest_centers: np.ndarray
    """One column after the other, shape (3, B)."""
    rest_quats: np.ndarray
    """w, x, y, z, shape (4, B)."""

    def pose(
        self,
        of_joints: np.ndarray,
        signs: np.ndarray,
        positions: np.ndarray,
        quats_wxyz: np.ndarray,
    ) -> None:
        """Pose the block.

        Args:
            of_joints: Rest-to-posed moves as 3x4 matrices, then their rotations wxyz, (J, 16).
            signs: -1 where two of these rotations are opposite, else 1, shape (J, J).
            positions: Receives the centers, shape (B, 3).
            quats_wxyz: Receives the rotations, shape (B, 4).
        """
        sums = np.ascontiguousarray((self.weight_matrix @ of_joints).T)
        x, y, z = self.rest_centers
        for axis in range(3):
            m = sums[4 * axis : 4 * axis + 4]
            positions[:, axis] = m[0] * x + m[1] * y + m[2] * z + m[3]
        turns = sums[12:]
        if signs.min() < 0:
            first = np.argmax(self.weights > 0, axis=1)
            first_ids = np.take_along_axis(self.joint_ids, first[:, None], axis=1)
            signed = _matrix(
                self.joint_ids, self.weights * signs[first_ids, self.joint_ids], len(signs)
            )
            turns = (signed @ of_joints[:, 12:]).T
        quats_wxyz[:] = quaternions.normalize(quaternions.multiply(turns.T, self.rest_quats.T))


def _blocks(splats: Splats, skin: Skin, joint_count: int) -> Iterator[_Block]:
    """Yield the Gaussians in blocks of columns."""
    weights = skin.weights / skin.weights.sum(axis=1, keepdims=True)  # as readers of a file do
    for first in range(0, len(splats), BLOCK_ROWS):
        rows = slice(first, first + BLOCK_ROWS)
        yield _Block(
            rows=rows,
            joint_ids=skin.joint_ids[rows],
            weights=weights[rows],
            weight_matrix=_matrix(skin.joint_ids[rows], weights[rows], joint_count),
            rest_centers=np.ascontiguousarray(splats.positions[rows].T),
            rest_quats=np.ascontiguousarray(splats.quats_wxyz[rows].T),
        )


def _matrix(joint_ids: np.ndarray, weights: np.ndarray, joint_count: int) -> "csr_array":
    """Return weights as a sparse matrix, shape (B, J): three times as fast as gathering rows."""
    # A third of a second, which a rig that poses no Gaussians need not wait for.
    from scipy.sparse import csr_array

    count, influences = joint_ids.shape
    ends = np.arange(0, count * influences + 1, influences, dtype=joint_ids.dtype)
    return csr_array((weights.ravel(), joint_ids.ravel(), ends), shape=(count, joint_count))
