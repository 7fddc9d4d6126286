"""Give each frame of the clip its camera."""

import logging
from collections.abc import Sequence
from pathlib import PurePath
from typing import TypeVar

import numpy as np

from animator.errors import InputError
from animator.scene.frames import ClipReading
from animator.scene.natural_order import last_number
from animator.scene.pinhole import fit_cameras, scale_camera
from animator.types import Camera

Key = TypeVar("Key", str, int)

logger = logging.getLogger(__name__)

_STATIC_TOLERANCE = 1e-6
"""Relative difference of poses and lenses below which a camera did not move."""


def clip_cameras(cameras: Sequence[Camera], clip: ClipReading, *, where: str) -> tuple[Camera, ...]:
    """Match the cameras of a file with the frames that were read, at their size.

    A camera belongs to the frame with the same file name, else with the same last number; if that
    fails and there is one for each frame of the clip, the order decides, with a warning.

    Args:
        cameras: All cameras of the file; one alone counts for all frames.
        clip: The frames.
        where: The file, for messages.

    Returns:
        One camera if it does not move, else one a frame.

    Raises:
        InputError: If a frame has no camera, or the shape of its image is another one.
    """
    matched = tuple(cameras) if len(cameras) == 1 else _match(cameras, clip, where)
    if all(_are_alike(matched[0], camera) for camera in matched[1:]):
        matched = matched[:1]
    fitted = fit_cameras(matched, clip.width_px, clip.height_px, where=where)
    height_px, width_px = clip.frames.images.shape[1:3]
    return tuple(scale_camera(camera, width_px, height_px) for camera in fitted)


def _match(cameras: Sequence[Camera], clip: ClipReading, where: str) -> tuple[Camera, ...]:
    names = [PurePath(name).stem for name in clip.frames.names]
    by_name = _by_key([PurePath(camera.name).stem for camera in cameras], cameras)
    if all(name in by_name for name in names):
        return tuple(by_name[name] for name in names)
    by_number = _by_key([last_number(camera.name) for camera in cameras], cameras)
    if all(number in by_number for number in clip.frames.numbers):
        if len(cameras) != clip.frame_count:
            logger.warning(
                "%s: matched its %d cameras with %d frames by number only (frame %r, camera %r); "
                "are they the cameras of this clip?",
                where,
                len(cameras),
                clip.frame_count,
                clip.frames.names[0],
                by_number[clip.frames.numbers[0]].name,
            )
        return tuple(by_number[number] for number in clip.frames.numbers)
    ordered = _in_order(cameras, clip)
    if ordered:
        logger.warning(
            "%s: its cameras do not name the frames (frame %r, camera %r): matched by order.",
            where,
            clip.frames.names[0],
            cameras[0].name,
        )
        return ordered
    missing = [
        frame_name
        for frame_name, name in zip(clip.frames.names, names, strict=True)
        if name not in by_name
    ]
    raise InputError(
        f"{where}: expected a camera for each of the {len(names)} frames, found {len(cameras)} "
        f"cameras and none for {', '.join(missing[:5])}{' ...' if len(missing) > 5 else ''}; "
        "name the frames in file_path, or give a single camera if it does not move."
    )


def _in_order(cameras: Sequence[Camera], clip: ClipReading) -> tuple[Camera, ...]:
    """Return a camera a frame if there are as many as frames, in the clip or in the selection."""
    if len(cameras) == clip.frame_count:
        return tuple(cameras[position] for position in clip.positions)
    return tuple(cameras) if len(cameras) == len(clip.frames) else ()


def _by_key(keys: Sequence[Key | None], cameras: Sequence[Camera]) -> dict[Key, Camera]:
    """Index cameras by a key; none of them if the key is missing or not unique."""
    if None in keys or len(set(keys)) < len(keys):
        return {}
    return {key: camera for key, camera in zip(keys, cameras, strict=True) if key is not None}


def _are_alike(first: Camera, second: Camera) -> bool:
    return (
        (first.width_px, first.height_px) == (second.width_px, second.height_px)
        and np.allclose(first.intrinsics, second.intrinsics, rtol=_STATIC_TOLERANCE, atol=0)
        and np.allclose(
            first.cam_from_world,
            second.cam_from_world,
            rtol=_STATIC_TOLERANCE,
            atol=_STATIC_TOLERANCE,
        )
    )
