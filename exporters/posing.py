"""From joint transforms to posed Gaussians: the forward kinematics and the skin."""

import numpy as np

from exporters import quaternions
from exporters.clip import Posed, Rig, Skin, Splats

BLOCK_LENGTH = 16384  # Gaussians a block: its temporaries stay in the processor's cache


def world_matrices(rig: Rig, translations: np.ndarray, quats_wxyz: np.ndarray) -> np.ndarray:
    """Compose parent-local transforms down the tree.

    Args:
        rig: The tree; parents come before children.
        translations: Parent-local translations [scene unit], shape (J, 3).
        quats_wxyz: Parent-local unit rotations, shape (J, 4).

    Returns:
        World-from-joint for column vectors, float64, shape (J, 4, 4).
    """
    matrices = local_matrices(translations, quats_wxyz)
    for joint, parent in enumerate(rig.parents):
        if parent >= 0:
            matrices[joint] = matrices[parent] @ matrices[joint]
    return matrices


def local_matrices(translations: np.ndarray, quats_wxyz: np.ndarray) -> np.ndarray:
    """Return parent-from-joint for column vectors, float64, shape (J, 4, 4)."""
    matrices = np.zeros((len(translations), 4, 4))
    matrices[:, :3, :3] = quaternions.to_matrices(quats_wxyz)
    matrices[:, :3, 3] = translations
    matrices[:, 3, 3] = 1.0
    return matrices


def skin_splats(splats: Splats, skin: Skin, skin_matrices: np.ndarray) -> Posed:
    """Move the Gaussians with their joints.

    Centers: linear blend skinning. Rotations: the joints' rotations, each with the sign nearest to
    that of the first influence of positive weight, summed by weight, normalized, and multiplied on
    the left of the rest rotation. A blend that cancels to zero (weights on opposite rotations)
    leaves the rest rotation.

    Args:
        splats: The rest pose.
        skin: Joints and weights of each Gaussian.
        skin_matrices: Rest-to-posed transform of each joint in world space, rigid, float64,
            shape (J, 4, 4).
    """
    rotations_wxyz = quaternions.from_matrices(skin_matrices[:, :3, :3])
    is_opposite = rotations_wxyz @ rotations_wxyz.T < 0
    affines = skin_matrices[:, :3].reshape(-1, 12)
    table = np.concatenate([affines, rotations_wxyz], axis=1).astype(np.float32)

    positions = np.zeros_like(splats.positions)
    quats_wxyz = np.zeros_like(splats.quats_wxyz)
    for start in range(0, len(splats), BLOCK_LENGTH):
        block = slice(start, start + BLOCK_LENGTH)
        blend = _blend(skin.joint_ids[block], skin.weights[block], table, is_opposite)
        affine = blend[:, :12].reshape(-1, 3, 4)
        rest = splats.positions[block]
        positions[block] = np.einsum("nij,nj->ni", affine[:, :, :3], rest) + affine[:, :, 3]
        turned = quaternions.multiply(
            quaternions.normalize(blend[:, 12:]), splats.quats_wxyz[block]
        )
        quats_wxyz[block] = quaternions.normalize(turned)
    return Posed(positions=positions, quats_wxyz=quats_wxyz)


def _blend(
    joint_ids: np.ndarray, weights: np.ndarray, table: np.ndarray, is_opposite: np.ndarray
) -> np.ndarray:
    """Sum the rows of `table` (12 affine entries, then a quaternion) by weight, shape (n, 16)."""
    first = np.take_along_axis(joint_ids, np.argmax(weights > 0, axis=1)[:, None], axis=1)
    signs = np.where(is_opposite[first, joint_ids], np.float32(-1), np.float32(1))
    blend = np.zeros((len(joint_ids), 16), np.float32)
    for influence in range(joint_ids.shape[1]):
        rows = table[joint_ids[:, influence]]
        rows[:, 12:] *= signs[:, influence, None]
        rows *= weights[:, influence, None]
        blend += rows
    return blend
