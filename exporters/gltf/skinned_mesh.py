"""A skinned mesh: what every glTF viewer plays."""

import numpy as np
import pygltflib

from exporters.errors import ClipError
from exporters.gltf.buffers import BinaryBuffer
from exporters.skinned_mesh import SkinnedMesh

_UINT8_JOINT_LIMIT = 256
_UINT16_JOINT_LIMIT = 65536
_UINT16_MAX = 65535


def add_skinned_mesh(
    document: pygltflib.GLTF2,
    buffer: BinaryBuffer,
    skinned: SkinnedMesh,
    *,
    joint_count: int,
    material: int,
) -> int:
    """Add a mesh with its skin attributes (glTF 2.0, section 3.7.3.3); return its index.

    Args:
        document: Receives the mesh.
        buffer: Receives its attributes.
        skinned: The mesh, Y-up, in meters.
        joint_count: Number of joints of the rig, which decides the width of a joint index.
        material: Index of the material.

    Raises:
        ClipError: If the rig has more joints than a glTF joint index can hold.
    """
    joint_type = joint_index_type(joint_count)
    colors = packed_colors(skinned.colors_linear, skinned.opacities)
    attributes = pygltflib.Attributes(
        POSITION=buffer.add_attribute(skinned.positions, bounds=True),
        NORMAL=buffer.add_attribute(skinned.normals),
        COLOR_0=buffer.add_attribute(colors, normalized=True),
        JOINTS_0=buffer.add_attribute(skinned.joint_ids.astype(joint_type)),
        WEIGHTS_0=buffer.add_attribute(skinned.weights),
    )
    primitive = pygltflib.Primitive(
        mode=pygltflib.TRIANGLES,
        attributes=attributes,
        indices=buffer.add_indices(skinned.triangles),
        material=material,
    )
    document.meshes.append(pygltflib.Mesh(name=skinned.name, primitives=[primitive]))
    return len(document.meshes) - 1


def joint_index_type(joint_count: int) -> type[np.uint8] | type[np.uint16]:
    """Return the narrowest type that numbers so many joints.

    Raises:
        ClipError: If there are more than 65536 joints.
    """
    if joint_count > _UINT16_JOINT_LIMIT:
        raise ClipError(
            f"rig: glTF numbers joints with 16 bits, so at most {_UINT16_JOINT_LIMIT}, but there "
            f"are {joint_count}; use fewer anchors, or write USD instead"
        )
    return np.uint8 if joint_count <= _UINT8_JOINT_LIMIT else np.uint16


def packed_colors(colors_linear: np.ndarray, opacities: np.ndarray) -> np.ndarray:
    """Return COLOR_0: linear RGB and opacity as normalized uint16, shape (V, 4).

    Eight bits would show steps in the dark colors, which linear encoding crowds together.

    Args:
        colors_linear: Linear colors 0..1, shape (V, 3).
        opacities: Opacities 0..1, shape (V,).
    """
    rgba = np.concatenate([colors_linear, opacities[:, None]], axis=1)
    return np.rint(rgba * np.float32(_UINT16_MAX)).astype(np.uint16)
