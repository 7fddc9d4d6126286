"""Tracks as one animation: linear keys, one time accessor for all channels."""

import dataclasses

import numpy as np
import pygltflib

from exporters.gltf import order
from exporters.gltf.buffers import BinaryBuffer
from exporters.keyframes import align_signs


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class NodeTracks:
    """The motion of some nodes, each relative to its parent."""

    nodes: list[int]
    """Indices of the nodes, length M."""
    translations: np.ndarray
    """Translations at each key [m], shape (T, M, 3)."""
    quats_wxyz: np.ndarray
    """Unit rotations at each key, sign-continuous, shape (T, M, 4)."""
    rest_translations: np.ndarray
    """What the nodes' own translations say [m], shape (M, 3)."""
    rest_quats_wxyz: np.ndarray
    """What the nodes' own rotations say, unit, shape (M, 4)."""


def add_animation(
    document: pygltflib.GLTF2,
    buffer: BinaryBuffer,
    times_s: np.ndarray,
    tracks: list[NodeTracks],
    extras: dict[str, object],
) -> None:
    """Add one animation with a channel for every property that leaves its rest value.

    A rig that never moves gets no animation: glTF forbids one without channels.

    Args:
        document: Receives the animation.
        buffer: Receives the keys.
        times_s: Key times [s], strictly increasing from 0, shape (T,).
        tracks: Motions with T keys each.
        extras: What glTF has no field for, kept with the animation.
    """
    animation = pygltflib.Animation(name="clip", extras=extras)
    times_accessor: int | None = None
    for track in tracks:
        for path, nodes, values in _moving_channels(track):
            if not nodes:
                continue
            if times_accessor is None:
                times_accessor = buffer.add_values(times_s.astype(np.float32), bounds=True)
            for node, accessor in zip(nodes, buffer.add_tracks(values), strict=True):
                animation.samplers.append(
                    pygltflib.AnimationSampler(
                        input=times_accessor,
                        output=accessor,
                        interpolation=pygltflib.ANIM_LINEAR,
                    )
                )
                animation.channels.append(
                    pygltflib.AnimationChannel(
                        sampler=len(animation.samplers) - 1,
                        target=pygltflib.AnimationChannelTarget(node=node, path=path),
                    )
                )
    if animation.channels:
        document.animations.append(animation)


def _moving_channels(track: NodeTracks) -> list[tuple[str, list[int], np.ndarray]]:
    """Return (path, nodes, key values of shape (M', T, D)) of translations and of rotations.

    A property moves if one of its keys differs from rest as the file stores them, in float32.
    """
    rest_wxyz = np.broadcast_to(track.rest_quats_wxyz, track.quats_wxyz.shape)
    near_rest_wxyz = align_signs(track.quats_wxyz, rest_wxyz)
    rotated = (order.xyzw(near_rest_wxyz) != order.xyzw(rest_wxyz)).any(axis=(0, 2))
    translations = track.translations.astype(np.float32)
    shifted = (translations != track.rest_translations.astype(np.float32)).any(axis=(0, 2))
    channels = []
    for path, moves, values in (
        ("translation", shifted, translations),
        ("rotation", rotated, order.xyzw(track.quats_wxyz)),
    ):
        nodes = [track.nodes[i] for i in np.flatnonzero(moves)]
        channels.append((path, nodes, values[:, moves].swapaxes(0, 1)))
    return channels
