"""Files that belong to the frames one by one: masks, depth maps."""

import logging
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from animator.errors import InputError
from animator.scene.natural_order import describe_ranges, last_number
from animator.types import Frames

logger = logging.getLogger(__name__)

_ASPECT_TOLERANCE = 0.01


def match_files(
    frames: Frames, folder: Path, suffixes: Collection[str], *, noun: str, flag: str
) -> list[Path | None]:
    """Find the file of each frame: `0007.png` or `0007.jpg.png` by name, else by number.

    Args:
        frames: The frames.
        folder: Where the files lie.
        suffixes: File name endings that count, lower case.
        noun: What one file is called in messages, such as `mask`.
        flag: The flag that names the folder, for messages.

    Returns:
        The file of each frame, None where there is none; length T.

    Raises:
        InputError: If there is no such folder.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of {noun}s ({flag}).")
    files = sorted(
        file
        for file in folder.iterdir()
        if file.suffix.lower() in suffixes and not file.name.startswith(".")
    )
    by_name = {file.stem: file for file in files}
    by_number: dict[int | None, Path | None] = {}
    for file in files:
        number = last_number(file.name)
        by_number[number] = None if number in by_number else file  # twice: ambiguous
    by_number.pop(None, None)
    return [
        by_name.get(Path(name).stem) or by_name.get(name) or by_number.get(number)
        for name, number in zip(frames.names, frames.numbers, strict=True)
    ]


def require_all(
    frames: Frames, folder: Path, files: Sequence[Path | None], *, noun: str
) -> list[Path]:
    """Return the files if every frame has one; arguments as of `match_files`.

    Raises:
        InputError: If a frame has none; names the first of those.
    """
    missing = [name for name, file in zip(frames.names, files, strict=True) if file is None]
    if missing:
        raise InputError(
            f"{folder}: expected a {noun} for each of the {len(frames)} frames, found none for "
            f"{len(missing)}: {', '.join(missing[:5])}{' ...' if len(missing) > 5 else ''}; "
            f"{noun}s are matched by file name (without its ending) or by their last number."
        )
    return [file for file in files if file is not None]


def require_aspect(
    file: Path, size_px: tuple[int, int], frames: Frames, index: int, *, noun: str
) -> None:
    """Accept another size than the frame's, but not another shape.

    Args:
        file: The file that belongs to the frame.
        size_px: Its width and height [px].
        frames: The frames.
        index: Which of them.
        noun: What the file is called in messages.

    Raises:
        InputError: If the aspect ratios differ by more than 1 %.
    """
    height_px, width_px = frames.images.shape[1:3]
    aspect_ratio = np.divide(*size_px) / np.divide(width_px, height_px)
    if abs(aspect_ratio - 1) > _ASPECT_TOLERANCE:
        raise InputError(
            f"{file}: the {noun} has {size_px[0]}x{size_px[1]} pixels, its frame "
            f"{frames.names[index]} has {width_px}x{height_px}, another aspect ratio."
        )


def warn_about(frames: Frames, is_odd: np.ndarray, what: str) -> None:
    """Warn once about all frames that something is odd with.

    Args:
        frames: The frames.
        is_odd: Which of them, bool, shape (T,).
        what: The verb and the rest of the sentence.
    """
    if is_odd.any():
        odd_numbers = [(frames.numbers[i], frames.numbers[i]) for i in np.flatnonzero(is_odd)]
        logger.warning(
            "%d of %d frames %s (%s).",
            len(odd_numbers),
            len(frames),
            what,
            describe_ranges(odd_numbers),
        )
