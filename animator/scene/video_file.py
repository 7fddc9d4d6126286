"""A video file as a source of frames, decoded one by one."""

import dataclasses
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from animator.errors import InputError
from animator.scene.image_file import Picture
from animator.scene.selection import FrameSelection

if TYPE_CHECKING:
    import cv2

logger = logging.getLogger(__name__)

VIDEO_SUFFIXES = frozenset(
    {".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".gif"}
)
"""File name endings that are read as video, lower case."""

_MAX_FPS = 1000.0
_MAX_FRAME_COUNT = 1e9
"""Beyond these, what the container says is not believed."""
_CONTAINER_MARKS = (
    (4, b"ftyp"), (4, b"moov"), (4, b"mdat"), (4, b"wide"), (4, b"free"), (4, b"skip"),  # MP4, MOV
    (0, b"RIFF"), (0, b"\x1aE\xdf\xa3"), (0, b"GIF8"),  # AVI; Matroska, WebM; GIF
    (0, b"\x00\x00\x01\xba"), (0, b"\x00\x00\x01\xb3"), (0, b"\x47"),  # MPEG
)  # fmt: skip


@dataclasses.dataclass(frozen=True, kw_only=True)
class VideoFile:
    """A video; its frames are numbered from 0."""

    path: Path
    """The file."""
    width_px: int
    """Width after rotation [px]."""
    height_px: int
    """Height after rotation [px]."""
    frame_count: int
    """Number of frames the container promises, 0 if it does not say; often a guess."""
    container_fps: float | None
    """Frames per second the container states, if plausible."""

    def pictures(self, selection: FrameSelection) -> Iterator[tuple[int, Picture]]:
        """Decode the selected frames; yields position (= number) and picture.

        Raises:
            InputError: If a selected frame does not exist, or no frame can be decoded.
        """
        capture = _open(self.path)
        times_s = []
        try:
            while not selection.is_past(len(times_s)) and capture.grab():
                position = len(times_s)
                times_s.append(_time_s(capture))
                if not selection.includes(position):
                    continue
                is_decoded, bgr = capture.retrieve()
                if not is_decoded:
                    raise InputError(f"{self.path}: frame {position} cannot be decoded.")
                yield position, _picture(bgr, f"{self.path.name}#{position}")
        finally:
            capture.release()
        if not times_s:
            raise InputError(f"{self.path}: expected a video, but no frame can be decoded.")
        if not selection.is_past(len(times_s)):
            self._report_short(len(times_s))
        self._report_uneven(times_s)
        selection.require(range(len(times_s)), str(self.path))

    def _report_short(self, decoded_count: int) -> None:
        if decoded_count < self.frame_count:
            logger.warning(
                "%s: the file promises %d frames, %d could be decoded; is it cut off?",
                self.path,
                self.frame_count,
                decoded_count,
            )

    def _report_uneven(self, times_s: list[float]) -> None:
        """Warn about a variable frame rate: the clip is treated as evenly spaced."""
        if self.container_fps is None or len(times_s) < 3:
            return
        offsets = np.array(times_s) - times_s[0] - np.arange(len(times_s)) / self.container_fps
        late = np.abs(offsets) > 1.5 / self.container_fps
        if late.any():
            logger.warning(
                "%s: variable frame rate: %d of %d frames are more than 1.5 frames off an even "
                "%.4g fps and are treated as even; re-encode at a constant rate to keep it.",
                self.path,
                int(late.sum()),
                len(times_s),
                self.container_fps,
            )


def open_video(path: Path) -> VideoFile:
    """Read what the container says about itself.

    Raises:
        InputError: If it is no video.
    """
    import cv2

    _require_container(path)
    capture = _open(path)
    try:
        fps = float(capture.get(cv2.CAP_PROP_FPS))
        frame_count = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        return VideoFile(
            path=path,
            width_px=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
            height_px=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
            frame_count=int(frame_count) if 0 < frame_count < _MAX_FRAME_COUNT else 0,
            container_fps=fps if 0 < fps <= _MAX_FPS else None,
        )
    finally:
        capture.release()


def _require_container(path: Path) -> None:
    """Refuse playlists, which FFmpeg would follow to other files and addresses."""
    with path.open("rb") as file:
        start = file.read(16)
    if not any(start[offset:].startswith(mark) for offset, mark in _CONTAINER_MARKS):
        raise InputError(
            f"{path}: expected a video ({', '.join(sorted(VIDEO_SUFFIXES))}), found a file that "
            f"starts with {start!r}; is it cut off, or of another type than its name says?"
        )


def _open(path: Path) -> "cv2.VideoCapture":
    import cv2

    # FFMPEG by name: the image backend would take a `%` in the name for a pattern.
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        raise InputError(
            f"{path}: expected a video, but it cannot be opened; is it cut off, or its codec "
            "unknown to FFmpeg? Re-encode it, for example with `ffmpeg -i IN -c:v libx264 OUT.mp4`."
        )
    return capture


def _time_s(capture: "cv2.VideoCapture") -> float:
    import cv2

    return float(capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000


def _picture(bgr: np.ndarray, name: str) -> Picture:
    return Picture(
        rgb=np.ascontiguousarray(bgr[..., ::-1]),
        alpha=np.full(bgr.shape[:2], 255, np.uint8),
        name=name,
    )
