"""The clip to animate, from a folder, a glob, a printf pattern or a video file."""

import dataclasses
import logging
import math
from collections.abc import Sequence
from pathlib import Path

from animator.errors import InputError
from animator.scene.frame_stack import FrameStack
from animator.scene.image_file import IMAGE_SUFFIXES, Picture
from animator.scene.image_sequence import (
    ImageSequence,
    images_from_file,
    images_from_pattern,
    images_in_folder,
    is_pattern,
)
from animator.scene.selection import FrameSelection
from animator.scene.video_file import VIDEO_SUFFIXES, VideoFile, open_video
from animator.types import Frames

logger = logging.getLogger(__name__)

DEFAULT_FPS = 24.0
"""Frames per second where neither the user nor the container says."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameOptions:
    """Which frames to read, and how."""

    numbers: tuple[int, ...] | None = None
    """Original frame numbers to keep (`--frames`); None keeps all."""
    every: int | None = None
    """Keep every N-th frame (`--every`)."""
    fps: float | None = None
    """Frames per second (`--fps`), over what the container says."""
    max_size_px: int | None = None
    """Average the frames down to at most this many pixels on the longer side."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ClipReading:
    """The frames, and what is known of their source."""

    frames: Frames
    """The selected frames."""
    positions: tuple[int, ...]
    """Place of each in the whole clip, from 0."""
    frame_count: int
    """Number of frames in the whole clip; for a video what the container promises, a guess."""
    width_px: int
    """Width before `max_size_px` [px]."""
    height_px: int
    """Height before `max_size_px` [px]."""
    fps_reason: str
    """Who said how fast: `--fps`, `the container`, `the default`."""


def open_frames(source: str | Path) -> ImageSequence | VideoFile:
    """Find out what the user means by a source of frames; decodes nothing.

    Args:
        source: A folder, an image, a video, a glob (`shot/*.png`) or a pattern
            (`frame_%04d.png`, `frame.####.png`).

    Raises:
        InputError: If there is nothing, or nothing that can be read.
    """
    path = Path(source).expanduser()
    if path.is_dir():
        return images_in_folder(path)
    if path.is_file():
        suffix = path.suffix.lower()
        if suffix in VIDEO_SUFFIXES:
            return open_video(path)
        if suffix in IMAGE_SUFFIXES:
            return images_from_file(path)
        raise InputError(
            f"{path}: expected a video ({', '.join(sorted(VIDEO_SUFFIXES))}) or images "
            f"({', '.join(sorted(IMAGE_SUFFIXES))}), found a {suffix or 'suffixless'} file."
        )
    if is_pattern(path):
        return images_from_pattern(path)
    raise InputError(
        f"{path}: there is no such file or folder; give a folder of images, a pattern such as "
        "frames/frame_%04d.png, or a video file."
    )


def read_frames(source: str | Path, options: FrameOptions | None = None) -> Frames:
    """Read the frames of a clip; alpha is 255 where the images have none.

    Args:
        source: See `open_frames`.
        options: What to keep; everything by default.

    Raises:
        InputError: If the source is missing, empty or unreadable, its frames differ in size, a
            selected frame does not exist, or the selection does not fit into memory.
    """
    return read_clip(open_frames(source), options or FrameOptions()).frames


def read_clip(source: ImageSequence | VideoFile, options: FrameOptions) -> ClipReading:
    """Decode the selected frames of an opened source; see `read_frames`."""
    fps, fps_reason = _resolve_fps(options.fps, source.container_fps)
    selection = FrameSelection.parse(numbers=options.numbers, every=options.every)
    target = _TargetSize.of(options.max_size_px)
    stack = FrameStack(str(source.path), selection.count_in(source.frame_count))
    positions: list[int] = []
    first_name, first_size_px = "", (0, 0)
    for position, picture in source.pictures(selection):
        if not positions:
            first_name, first_size_px = picture.name, picture.size_px
        if picture.size_px != first_size_px:
            raise InputError(
                f"{source.path}: the frames differ in size: {first_name} has "
                f"{first_size_px[0]}x{first_size_px[1]} pixels, {picture.name} has "
                f"{picture.size_px[0]}x{picture.size_px[1]}; bring them to one size, or select "
                "frames of one size with --frames."
            )
        positions.append(position)
        stack.append(target.fit(picture))
    images, alphas = stack.arrays()
    frames = Frames(
        images=images,
        alphas=alphas,
        numbers=_numbers_at(source, positions),
        names=tuple(stack.names),
        fps=fps,
    )
    return ClipReading(
        frames=frames,
        positions=tuple(positions),
        frame_count=source.frame_count,
        width_px=first_size_px[0],
        height_px=first_size_px[1],
        fps_reason=fps_reason,
    )


def select_frames(
    frames: Frames, *, numbers: Sequence[int] | None = None, every: int | None = None
) -> Frames:
    """Keep the frames with the given original numbers, or every N-th.

    Raises:
        InputError: If a number does not exist, or both are given.
    """
    selection = FrameSelection.parse(numbers=numbers, every=every)
    return frames.take(selection.positions(frames.numbers, "The clip"))


@dataclasses.dataclass(frozen=True, kw_only=True)
class _TargetSize:
    max_size_px: int | None

    @classmethod
    def of(cls, max_size_px: int | None) -> "_TargetSize":
        if max_size_px is not None and max_size_px < 1:
            raise InputError(f"max_size_px: expected 1 pixel or more, found {max_size_px}.")
        return cls(max_size_px=max_size_px)

    def fit(self, picture: Picture) -> Picture:
        longer_px = max(picture.size_px)
        if self.max_size_px is None or longer_px <= self.max_size_px:
            return picture
        scale = self.max_size_px / longer_px
        width_px, height_px = (max(1, round(side_px * scale)) for side_px in picture.size_px)
        return picture.resized(width_px, height_px)


def _numbers_at(source: ImageSequence | VideoFile, positions: list[int]) -> tuple[int, ...]:
    if isinstance(source, VideoFile):
        return tuple(positions)
    return tuple(source.numbers[position] for position in positions)


def _resolve_fps(wanted_fps: float | None, container_fps: float | None) -> tuple[float, str]:
    if wanted_fps is not None:
        if not (math.isfinite(wanted_fps) and wanted_fps > 0):
            raise InputError(f"--fps: expected a positive number, found {wanted_fps}.")
        return wanted_fps, "--fps"
    if container_fps is not None:
        return container_fps, "the container"
    return DEFAULT_FPS, "the default"
