"""The exact splats at rest, as a `KHR_gaussian_splatting` primitive.

The extension defines neither skins nor animation of splats, so this primitive stands still. It is
therefore alone in a second scene, `rest_splats`: a viewer that opens the file shows the default
scene with the animated carrier, never both on top of each other, and a tool that wants the splats
finds them by scene, node or mesh name. The extension is listed as used, never as required: readers
that do not know it would refuse the file (Blender 5.0 does); so they get colored points.
"""

import pygltflib

from exporters.carrier import base_colors_linear
from exporters.clip import Splats
from exporters.gltf import order
from exporters.gltf.buffers import BinaryBuffer
from exporters.gltf.skinned_mesh import packed_colors

SPLAT_EXTENSION = "KHR_gaussian_splatting"
REST_SPLATS_NAME = "rest_splats"


def add_splat_mesh(
    document: pygltflib.GLTF2,
    buffer: BinaryBuffer,
    splats: Splats,
    material: int,
    *,
    name: str = REST_SPLATS_NAME,
) -> int:
    """Add splats as they are; return the index of the mesh.

    Args:
        document: Receives the mesh.
        buffer: Receives its attributes.
        splats: Y-up, in meters; scales and opacities are linear there as here.
        material: Material of the fallback points, for readers without the extension.
        name: Name of the mesh.
    """
    attributes = pygltflib.Attributes(
        POSITION=buffer.add_attribute(splats.positions, bounds=True),
        COLOR_0=buffer.add_attribute(
            packed_colors(base_colors_linear(splats), splats.opacities), normalized=True
        ),
    )
    own_attributes = {
        "ROTATION": order.xyzw(splats.quats_wxyz),
        "SCALE": splats.scales,
        "OPACITY": splats.opacities,
    }
    for semantic, values in own_attributes.items():
        setattr(attributes, f"{SPLAT_EXTENSION}:{semantic}", buffer.add_attribute(values))
    for degree in range(splats.sh_degree + 1):
        for index in range(2 * degree + 1):
            # Degree l starts at coefficient l^2; m runs from -l to l, as in the training code.
            coefficients = splats.sh_coeffs[:, degree * degree + index, :]
            semantic = f"{SPLAT_EXTENSION}:SH_DEGREE_{degree}_COEF_{index}"
            setattr(attributes, semantic, buffer.add_attribute(coefficients))
    primitive = pygltflib.Primitive(
        mode=pygltflib.POINTS,
        attributes=attributes,
        material=material,
        extensions={
            SPLAT_EXTENSION: {
                "kernel": "ellipse",
                "colorSpace": "srgb_rec709_display",
                "projection": "perspective",
                "sortingMethod": "cameraDistance",
            }
        },
    )
    document.meshes.append(pygltflib.Mesh(name=name, primitives=[primitive]))
    if SPLAT_EXTENSION not in document.extensionsUsed:
        document.extensionsUsed.append(SPLAT_EXTENSION)
    return len(document.meshes) - 1
