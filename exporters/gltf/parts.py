"""The splats in motion, as rigid pieces: one `KHR_gaussian_splatting` primitive each, on a node.

The extension knows no skin, but says what a node does to splats: its matrix moves their centers and
shapes them, and its rotation should turn their spherical harmonics ("Splat Lighting"; viewers that
do not follow keep view-dependent colors fixed to the part). So a viewer needs nothing beyond the
specification to play this. What it costs is the bending within a piece: `fit_parts` measures it.

Like the splats at rest, the pieces lie in a scene of their own, so that no viewer draws them on top
of a mesh; where there is no mesh, they are the default scene.
"""

import dataclasses
import logging

import numpy as np
import pygltflib

from exporters.clip import Clip
from exporters.gltf.animation import NodeTracks
from exporters.gltf.buffers import BinaryBuffer
from exporters.gltf.splats import add_splat_mesh
from exporters.rigid_parts import RigidParts, fit_parts

SPLAT_PARTS_NAME = "splat_parts"

_log = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SplatParts:
    """The pieces in a document."""

    root: int
    """The node above all of them, which stands still."""
    tracks: NodeTracks
    """Their motion."""


def add_parts(
    document: pygltflib.GLTF2, buffer: BinaryBuffer, clip: Clip, material: int
) -> SplatParts:
    """Add one mesh and one node a rigid piece; the log says how far they are from the exact motion.

    Positions are stored from each piece's origin, where its node stands: so the centers move on
    straight lines between two keys, and turn about themselves.

    Args:
        document: Receives meshes and nodes.
        buffer: Receives the attributes.
        clip: Y-up, in meters.
        material: Material of the fallback points, for readers without the extension.
    """
    parts = fit_parts(clip)
    nodes = []
    for name, members, origin in zip(parts.names, parts.members, parts.origins, strict=True):
        splats = clip.splats.subset(members)
        local = dataclasses.replace(splats, positions=splats.positions - origin)
        mesh = add_splat_mesh(document, buffer, local, material, name=name)
        nodes.append(len(document.nodes))
        document.nodes.append(pygltflib.Node(name=name, mesh=mesh, translation=origin.tolist()))
    root = len(document.nodes)
    document.nodes.append(pygltflib.Node(name=SPLAT_PARTS_NAME, children=nodes))
    _report(clip, parts)
    tracks = NodeTracks(
        nodes=nodes,
        translations=parts.translations,
        quats_wxyz=parts.quats_wxyz,
        rest_translations=parts.origins,
        rest_quats_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (len(nodes), 1)),
        times_s=parts.times_s,
    )
    return SplatParts(root=root, tracks=tracks)


def _report(clip: Clip, parts: RigidParts) -> None:
    error = parts.error
    _log.info(
        "%s: %d rigid pieces for %d Gaussians; off by %.2g %% of the diagonal and %.2g degrees on "
        "average, %.2g %% and %.2g degrees at the 95th percentile, %.2g %% and %.2g degrees at most",
        clip.name,
        len(parts.names),
        len(clip.splats),
        error.mean_percent,
        error.mean_degrees,
        error.p95_percent,
        error.p95_degrees,
        error.max_percent,
        error.max_degrees,
    )
