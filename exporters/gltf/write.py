"""A `Clip` to .glb, or to .gltf with its .bin beside it."""

from pathlib import Path
from urllib.parse import quote

import pygltflib

from exporters.adaptation import adapt_to_gltf
from exporters.atomic import replacing
from exporters.clip import Clip
from exporters.errors import ClipError
from exporters.gltf.animation import NodeTracks, add_animation
from exporters.gltf.buffers import BinaryBuffer
from exporters.gltf.camera import add_camera
from exporters.gltf.materials import Materials
from exporters.gltf.parts import SPLAT_PARTS_NAME, add_parts
from exporters.gltf.skeleton import add_joints, add_skin
from exporters.gltf.skinned_mesh import add_skinned_mesh
from exporters.gltf.splats import REST_SPLATS_NAME, add_splat_mesh
from exporters.joint_limit import within_limit
from exporters.key_reduction import find_kept_keys
from exporters.meshes import meshes_of
from exporters.options import ExportOptions

GENERATOR = "Splatimate"

GLB_BLOB_LIMIT_BYTES = 2**32 - 2**27
"""A .glb counts its own bytes with 32 bits (glTF 2.0, section 4.4.2); the JSON needs room too."""


def write_gltf(
    clip: Clip, path: str | Path, options: ExportOptions | None = None
) -> tuple[Path, ...]:
    """Write the rigged asset as glTF 2.0.

    The default scene holds the skeleton below a node of the clip's name, the skinned meshes
    (by default the carrier) and the solved camera; a second scene, `rest_splats`, the exact splats
    at rest, or `splat_parts`, the splats as rigid pieces in motion. Without a mesh these are in the
    default scene.

    Args:
        clip: What to write, any up axis and unit; the file is Y-up, in meters and seconds.
        path: Target, `.glb` (one file) or `.gltf` (with a `.bin` beside it).
        options: Choices; None for the defaults.

    Returns:
        The files written, the one to open first.

    Raises:
        ClipError: If the clip is not valid, too large for a .glb, or the suffix is not glTF's.
        WriteError: If a file cannot be written; no partial file remains.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".glb", ".gltf"):
        raise ClipError(f"{path}: expected a name ending in .glb or .gltf, got {path.suffix!r}")
    clip.validate()
    options = options or ExportOptions()
    clip = within_limit(adapt_to_gltf(clip, options), options.joint_limit)
    document, blob = build_document(clip, options)
    if suffix == ".glb":
        if len(blob) > GLB_BLOB_LIMIT_BYTES:
            raise ClipError(
                f"{path}: {len(clip.splats)} Gaussians make {len(blob) / 2**30:.1f} GiB, but a "
                ".glb ends at 4 GiB; write a .gltf, or leave out the splats"
            )
        document.set_binary_blob(blob)
        with replacing(path) as partial:
            document.save_binary(partial)
        return (path,)
    blob_path = path.with_suffix(".bin")
    document.buffers[0].uri = quote(blob_path.name)
    # The document appears last: whoever sees it finds its buffer in place.
    with replacing(path) as partial:
        partial.write_text(document.gltf_to_json(), encoding="utf-8")
        with replacing(blob_path) as partial_blob:
            partial_blob.write_bytes(blob)
    return path, blob_path


def build_document(clip: Clip, options: ExportOptions) -> tuple[pygltflib.GLTF2, bytes]:
    """Describe a clip as glTF objects and one binary buffer.

    Args:
        clip: A valid clip, Y-up, in meters.
        options: What to include.

    Returns:
        The document, whose only buffer has no uri yet, and the bytes of that buffer.
    """
    document = pygltflib.GLTF2(asset=pygltflib.Asset(generator=GENERATOR), scene=0)
    buffer = BinaryBuffer(document)

    joint_nodes = add_joints(document, clip.rig, clip.uncertainty)
    tracks = [_joint_tracks(clip, joint_nodes, options)]
    children = [joint_nodes[0]]
    if clip.camera is not None:
        tracks.append(add_camera(document, clip, clip.camera))
        children += tracks[-1].nodes
    root = _add_node(document, pygltflib.Node(name=clip.name, children=children))

    materials = Materials(document, options.alpha_cutoff)
    skinned = [
        pygltflib.Node(
            name=mesh.name,
            mesh=add_skinned_mesh(
                document,
                buffer,
                mesh,
                joint_count=len(clip.rig),
                material=materials.surface_colors if mesh.is_closed else materials.splat_colors,
            ),
        )
        for mesh in meshes_of(clip, options)
    ]
    # Without a mesh too: importers tell joints from plain nodes by the skin.
    skin = add_skin(document, buffer, clip, joint_nodes)
    # A skinned mesh ignores its parents (glTF 2.0, section 3.7.3.2), hence at the scene's root.
    nodes = [root]
    for node in skinned:
        node.skin = skin
        nodes.append(_add_node(document, node))
    document.scenes.append(pygltflib.Scene(name=clip.name, nodes=nodes))
    if options.splats == "parts":
        parts = add_parts(document, buffer, clip, materials.splat_colors)
        tracks.append(parts.tracks)
        if skinned:
            document.scenes.append(pygltflib.Scene(name=SPLAT_PARTS_NAME, nodes=[parts.root]))
        else:
            nodes.append(parts.root)

    extras = {"fps": float(clip.fps), "source_frames": [int(i) for i in clip.source_frames]}
    add_animation(document, buffer, clip.tracks.times_s, tracks, extras)

    if options.splats == "rest":
        mesh = add_splat_mesh(document, buffer, clip.splats, materials.splat_colors)
        splats = _add_node(document, pygltflib.Node(name=REST_SPLATS_NAME, mesh=mesh))
        document.scenes.append(pygltflib.Scene(name=REST_SPLATS_NAME, nodes=[splats]))
    return document, buffer.finish()


def _add_node(document: pygltflib.GLTF2, node: pygltflib.Node) -> int:
    document.nodes.append(node)
    return len(document.nodes) - 1


def _joint_tracks(clip: Clip, joint_nodes: list[int], options: ExportOptions) -> NodeTracks:
    return NodeTracks(
        nodes=joint_nodes,
        translations=clip.tracks.translations,
        quats_wxyz=clip.tracks.quats_wxyz,
        rest_translations=clip.rig.rest_translations,
        rest_quats_wxyz=clip.rig.rest_quats_wxyz,
        kept=find_kept_keys(clip, options, shared=False) if options.tolerance else None,
    )
