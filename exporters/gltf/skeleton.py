"""The rig as nodes and a skin."""

import numpy as np
import pygltflib

from exporters.clip import Clip, Rig
from exporters.gltf import order
from exporters.gltf.buffers import BinaryBuffer


def add_joints(document: pygltflib.GLTF2, rig: Rig) -> list[int]:
    """Add one node a joint, at rest; return their indices in joint order.

    Args:
        document: Receives the nodes.
        rig: Joints, parents before children; joint 0 is the root.
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
    return list(range(first, first + len(rig)))


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
