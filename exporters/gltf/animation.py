"""Tracks as one animation: linear keys; channels with the same key times share one accessor."""

import dataclasses
from collections.abc import Iterator

import numpy as np
import pygltflib

from exporters.gltf import order
from exporters.gltf.buffers import BinaryBuffer
from exporters.keyframes import align_signs, continue_signs

_KEY_BYTES = 28  # a translation and a rotation in float32
_TIME_BYTES = 4
_ACCESSOR_BYTES = 170  # the JSON of one more accessor


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
    times_s: np.ndarray | None = None
    """Key times of these nodes [s], shape (T,); None for those of the animation."""
    kept: np.ndarray | None = None
    """Which keys each node keeps, first and last always, bool, shape (T, M); None for all."""


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
        tracks: Motions with T keys each, or with times of their own.
        extras: What glTF has no field for, kept with the animation.
    """
    moving = [channels for track in tracks for channels in _moving_channels(track, times_s)]
    if not moving:
        return
    inputs = {times.tobytes(): times for channels in moving for times in channels.times}
    time_accessors = buffer.add_tracks(list(inputs.values()), bounds=True)
    accessor_of_times = dict(zip(inputs, time_accessors, strict=True))

    animation = pygltflib.Animation(name="clip", extras=extras)
    for channels in moving:
        accessors = buffer.add_tracks(channels.values)
        for node, times, accessor in zip(channels.nodes, channels.times, accessors, strict=True):
            sampler = pygltflib.AnimationSampler(
                input=accessor_of_times[times.tobytes()],
                output=accessor,
                interpolation=pygltflib.ANIM_LINEAR,
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
    times: list[np.ndarray]
    """Key times of each node [s], float32, shape (keys,)."""
    values: list[np.ndarray]
    """These keys as the file stores them, float32, shape (keys, 3) or (keys, 4)."""


def _moving_channels(track: NodeTracks, times_s: np.ndarray) -> Iterator[_Channels]:
    """Yield the properties that move: a key differs from rest as the file stores it, in float32."""
    times = (times_s if track.times_s is None else track.times_s).astype(np.float32)
    translations = track.translations.astype(np.float32)
    shifted = translations != track.rest_translations.astype(np.float32)
    rest_wxyz = np.broadcast_to(track.rest_quats_wxyz, track.quats_wxyz.shape)
    near_rest_wxyz = align_signs(track.quats_wxyz, rest_wxyz)
    rotated = order.xyzw(near_rest_wxyz) != order.xyzw(rest_wxyz)
    kept = _worthwhile(track.kept) if track.kept is not None else None
    for path, differs, values in (
        ("translation", shifted, translations),
        ("rotation", rotated, order.xyzw(track.quats_wxyz)),
    ):
        movers = np.flatnonzero(differs.any(axis=(0, 2)))
        if not len(movers):
            continue
        every = values[:, movers].swapaxes(0, 1)
        if kept is None:
            masks = [np.ones(len(values), dtype=bool)] * len(movers)
            thinned = list(every)
        else:
            masks = [_without_constants(kept[:, m], v) for m, v in zip(movers, every, strict=True)]
            thinned = [v[mask] for v, mask in zip(every, masks, strict=True)]
            if path == "rotation":
                thinned = [continue_signs(v) for v in thinned]
        nodes = [track.nodes[mover] for mover in movers]
        node_times = [times[mask] for mask in masks]
        yield _Channels(path=path, nodes=nodes, times=node_times, values=thinned)


def _worthwhile(kept: np.ndarray) -> np.ndarray:
    """Return all keys for nodes whose own key times would take more room than they save."""
    masks, group_ids, sizes = np.unique(kept, axis=1, return_inverse=True, return_counts=True)
    key_counts = np.count_nonzero(masks, axis=0)
    saved_bytes = sizes * (len(kept) - key_counts) * _KEY_BYTES
    costs = saved_bytes <= key_counts * _TIME_BYTES + _ACCESSOR_BYTES
    return kept | costs[group_ids.reshape(-1)]


def _without_constants(mask: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Keep only the first and the last key of a channel that never changes."""
    if (values != values[0]).any():
        return mask
    ends = np.zeros_like(mask)
    ends[[0, -1]] = True
    return ends
