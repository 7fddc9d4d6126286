"""The skinned mesh that every glTF viewer plays: one quad a Gaussian."""

import numpy as np
import pygltflib

from exporters.carrier import carrier_quads, per_vertex
from exporters.clip import Clip, Skin
from exporters.errors import ClipError
from exporters.gltf.buffers import BinaryBuffer

UNLIT_EXTENSION = "KHR_materials_unlit"

_UINT8_JOINT_LIMIT = 256
_UINT16_JOINT_LIMIT = 65536
_UINT16_MAX = 65535


def add_material(document: pygltflib.GLTF2, alpha_cutoff: float) -> int:
    """Add the material of the carrier; return its index.

    Unlit, because a splat's color already contains the light. Alpha MASK, because blending would
    need the quads sorted by depth, which no viewer does within one mesh: with MASK the depth buffer
    decides and the surface is closed from every side. On three test models MASK came 4 to 7 dB
    nearer to the photographs than unsorted blending; a cutoff of 0.2 was best for a trained model
    with many faint Gaussians, and made no difference to the others.

    Args:
        document: Receives the material.
        alpha_cutoff: Opacity below which a quad is not drawn, 0..1.
    """
    document.materials.append(
        pygltflib.Material(
            name="splat_colors",
            alphaMode=pygltflib.MASK,
            alphaCutoff=alpha_cutoff,
            doubleSided=True,
            pbrMetallicRoughness=pygltflib.PbrMetallicRoughness(
                metallicFactor=0.0, roughnessFactor=1.0
            ),
            extensions={UNLIT_EXTENSION: {}},
        )
    )
    document.extensionsUsed.append(UNLIT_EXTENSION)
    return len(document.materials) - 1


def add_carrier_mesh(
    document: pygltflib.GLTF2, buffer: BinaryBuffer, clip: Clip, material: int
) -> int:
    """Add the carrier mesh with its skin attributes; return its index.

    Args:
        document: Receives the mesh.
        buffer: Receives its attributes.
        clip: Gaussians and skin, Y-up, in meters.
        material: Index of the material.

    Raises:
        ClipError: If the rig has more joints than a glTF joint index can hold.
    """
    carrier = carrier_quads(clip.splats)
    joints, weights = skin_attributes(clip.skin, joint_count=len(clip.rig))
    attributes = pygltflib.Attributes(
        POSITION=buffer.add_attribute(carrier.positions, bounds=True),
        NORMAL=buffer.add_attribute(carrier.normals),
        COLOR_0=buffer.add_attribute(
            packed_colors(carrier.colors_linear, carrier.opacities), normalized=True
        ),
        JOINTS_0=buffer.add_attribute(per_vertex(joints)),
        WEIGHTS_0=buffer.add_attribute(per_vertex(weights)),
    )
    primitive = pygltflib.Primitive(
        mode=pygltflib.TRIANGLES,
        attributes=attributes,
        indices=buffer.add_indices(carrier.triangles),
        material=material,
    )
    document.meshes.append(pygltflib.Mesh(name="carrier", primitives=[primitive]))
    return len(document.meshes) - 1


def skin_attributes(skin: Skin, *, joint_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return JOINTS_0 and WEIGHTS_0 of each Gaussian (glTF 2.0, section 3.7.3.3).

    Args:
        skin: Joints and weights of N Gaussians.
        joint_count: Number of joints, which decides the width of an index.

    Returns:
        Joint indices, 0 where the weight is 0, uint8 or uint16, shape (N, 4), and weights whose sum
        is 1 to float32 precision, shape (N, 4).

    Raises:
        ClipError: If there are more than 65536 joints.
    """
    if joint_count > _UINT16_JOINT_LIMIT:
        raise ClipError(
            f"rig: glTF numbers joints with 16 bits, so at most {_UINT16_JOINT_LIMIT}, but there "
            f"are {joint_count}; use fewer anchors, or write USD instead"
        )
    dtype = np.uint8 if joint_count <= _UINT8_JOINT_LIMIT else np.uint16
    exact = skin.weights.astype(np.float64)
    weights = (exact / exact.sum(axis=1, keepdims=True)).astype(np.float32)
    joints = np.where(weights > 0, skin.joint_ids, 0).astype(dtype)
    return joints, weights


def packed_colors(colors_linear: np.ndarray, opacities: np.ndarray) -> np.ndarray:
    """Return COLOR_0: linear RGB and opacity as normalized uint16, shape (V, 4).

    Eight bits would show steps in the dark colors, which linear encoding crowds together.

    Args:
        colors_linear: Linear colors 0..1, shape (V, 3).
        opacities: Opacities 0..1, shape (V,).
    """
    rgba = np.concatenate([colors_linear, opacities[:, None]], axis=1)
    return np.rint(rgba * np.float32(_UINT16_MAX)).astype(np.uint16)
