"""Tracks as one animation: linear keys, one time accessor for all channels."""

import dataclasses
from collections.abc import Iterator

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
    moving = [channels for track in tracks for channels in _moving_channels(track)]
    if not moving:
        return
    animation = pygltflib.Animation(name="clip", extras=extras)
    times_accessor = buffer.add_values(times_s.astype(np.float32), bounds=True)
    for channels in moving:
        accessors = buffer.add_tracks(channels.values)
        for node, accessor in zip(channels.nodes, accessors, strict=True):
            sampler = pygltflib.AnimationSampler(
                input=times_accessor, output=accessor, interpolation=pygltflib.ANIM_LINEAR
            )
            channel = pygltflib.AnimationChannel(
                sampler=len(animation.samplers),
                target=pygltflib.AnimationChannelTarget(node=node, path=channels.path),
            )
            animation.samplers.append(sampler)
            animation.channels.append(channel)
    document.animations.append(animation)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Channels:
    """The same property of several nodes, all of which leave rest."""

    path: str
    nodes: list[int]
    values: np.ndarray
    """Keys as the file stores them, float32, shape (nodes, T, 3) or (nodes, T, 4)."""


def _moving_channels(track: NodeTracks) -> Iterator[_Channels]:
    """Yield the properties that move: a key differs from rest as the file stores it, in float32."""
    translations = track.translations.astype(np.float32)
    shifted = translations != track.rest_translations.astype(np.float32)
    rest_wxyz = np.broadcast_to(track.rest_quats_wxyz, track.quats_wxyz.shape)
    near_rest_wxyz = align_signs(track.quats_wxyz, rest_wxyz)
    rotated = order.xyzw(near_rest_wxyz) != order.xyzw(rest_wxyz)
    for path, differs, values in (
        ("translation", shifted, translations),
        ("rotation", rotated, order.xyzw(track.quats_wxyz)),
    ):
        movers = np.flatnonzero(differs.any(axis=(0, 2)))
        if len(movers):
            nodes = [track.nodes[mover] for mover in movers]
            yield _Channels(path=path, nodes=nodes, values=values[:, movers].swapaxes(0, 1))
