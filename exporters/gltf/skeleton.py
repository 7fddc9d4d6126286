"""The rig as nodes and a skin."""

import numpy as np
import pygltflib

from exporters.clip import Clip, Rig, Uncertainty
from exporters.gltf import order
from exporters.gltf.buffers import BinaryBuffer

EXTRAS_DIGITS = 4
"""Significant digits of the numbers in extras, which are text."""


def add_joints(
    document: pygltflib.GLTF2, rig: Rig, uncertainty: Uncertainty | None = None
) -> list[int]:
    """Add one node a joint, at rest; return their indices in joint order.

    A joint's uncertainty is in its node's extras, as `splatimate_uncertainty_m`: the mean over the
    keys, since extras cannot be animated; USD holds it key by key.

    Args:
        document: Receives the nodes.
        rig: Joints, parents before children; joint 0 is the root.
        uncertainty: How well they were observed [m], if that is known.
    """
    first = len(document.nodes)
    rotations_xyzw = order.xyzw(rig.rest_quats_wxyz)
    for joint, name in enumerate(rig.joint_names):
        document.nodes.append(
            pygltflib.Node(
                name=name,
                translation=rig.rest_translations[joint].tolist(),
                rotation=rotations_xyzw[joint].tolist(),
                children=(first + np.flatnonzero(rig.parents == joint)).tolist(),
            )
        )
        if uncertainty is not None:
            document.nodes[-1].extras = {"splatimate_uncertainty_m": _means(uncertainty, joint)}
    return list(range(first, first + len(rig)))


def _means(uncertainty: Uncertainty, joint: int) -> dict[str, float]:
    return {
        field: float(f"{array[:, joint].mean(dtype=np.float64):.{EXTRAS_DIGITS}g}")
        for field, array in vars(uncertainty).items()
    }


def add_skin(
    document: pygltflib.GLTF2, buffer: BinaryBuffer, clip: Clip, joint_nodes: list[int]
) -> int:
    """Add the skin whose bind pose is the rest pose; return its index.

    Args:
        document: Receives the skin.
        buffer: Receives the inverse bind matrices.
        clip: Y-up, in meters.
        joint_nodes: Their nodes, from `add_joints`.
    """
    joint_from_model = np.linalg.inv(clip.bind_matrices())
    document.skins.append(
        pygltflib.Skin(
            name="skin",
            skeleton=joint_nodes[0],
            joints=joint_nodes,
            inverseBindMatrices=buffer.add_values(order.column_major(joint_from_model)),
        )
    )
    return len(document.skins) - 1
