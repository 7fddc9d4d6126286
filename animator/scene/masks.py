"""Where the object is in each frame: from alpha, from mask files, or found automatically."""

import dataclasses
import logging
from pathlib import Path
from typing import Literal

import numpy as np

from animator.errors import InputError
from animator.scene.border_background import object_mask
from animator.scene.image_file import IMAGE_SUFFIXES, Picture, read_image
from animator.scene.natural_order import describe_ranges, last_number
from animator.types import Frames

logger = logging.getLogger(__name__)

_ASPECT_TOLERANCE = 0.01
_OPAQUE = 255


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Masks:
    """Coverage of the object in each frame, and where it was taken from."""

    alphas: np.ndarray
    """Coverage 0..255, uint8, shape (T, H, W)."""
    origin: Literal["alpha", "files", "automatic", "none"]
    """`none`: nothing was found in any frame, and all alphas are 255."""
    note: str
    """One sentence for the user."""


def find_masks(
    frames: Frames, folder: Path | None = None, *, is_folder_explicit: bool = False
) -> Masks:
    """Choose the masks: the images' alpha, else the mask files, else automatic ones.

    Args:
        frames: The frames; all alphas 255 means that the images have none.
        folder: Folder with one mask a frame, matched by file name or number.
        is_folder_explicit: The user named the folder: it wins over alpha, and must match.

    Raises:
        InputError: If masks are missing for some frames, have another shape, or are unreadable.
    """
    if is_folder_explicit and folder is not None:
        return _masks_from_files(frames, folder, _match_files(frames, folder))
    if (frames.alphas < _OPAQUE).any():
        return _masks_from_alpha(frames)
    if folder is not None:
        files = _match_files(frames, folder)
        if any(file is not None for file in files):
            return _masks_from_files(frames, folder, files)
        logger.warning(
            "%s: none of its masks has the name or number of a frame (first frame %r): not used; "
            "rename them, or name the right folder with --masks.",
            folder,
            frames.names[0],
        )
    return _automatic_masks(frames)


def _masks_from_alpha(frames: Frames) -> Masks:
    coverage = frames.alphas.reshape(len(frames), -1)
    _warn_about(frames, coverage.min(axis=1) == _OPAQUE, "are opaque all over, unlike the others")
    _warn_about(frames, coverage.max(axis=1) == 0, "are wholly transparent: nothing to see there")
    return Masks(alphas=frames.alphas, origin="alpha", note="Masks: the images' alpha.")


def _warn_about(frames: Frames, is_odd: np.ndarray, what: str) -> None:
    if is_odd.any():
        odd_numbers = [(frames.numbers[i], frames.numbers[i]) for i in np.flatnonzero(is_odd)]
        logger.warning(
            "%d of %d frames %s (%s).",
            len(odd_numbers),
            len(frames),
            what,
            describe_ranges(odd_numbers),
        )


def _match_files(frames: Frames, folder: Path) -> list[Path | None]:
    """Find the mask file of each frame: `0007.png` or `0007.jpg.png` by name, else by number."""
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder of masks (--masks).")
    files = sorted(
        file
        for file in folder.iterdir()
        if file.suffix.lower() in IMAGE_SUFFIXES and not file.name.startswith(".")
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


def _masks_from_files(frames: Frames, folder: Path, files: list[Path | None]) -> Masks:
    missing = [name for name, file in zip(frames.names, files, strict=True) if file is None]
    if missing:
        raise InputError(
            f"{folder}: expected a mask for each of the {len(frames)} frames, found none for "
            f"{len(missing)}: {', '.join(missing[:5])}{' ...' if len(missing) > 5 else ''}; masks "
            "are matched by file name (without its ending) or by their last number."
        )
    alphas = np.empty_like(frames.alphas)
    largest = 0
    for index, file in enumerate(files):
        if file is None:
            continue
        alphas[index] = _read_mask(file, frames, index)
        largest = max(largest, int(alphas[index].max()))
    if largest == 1:
        logger.warning("%s: the masks hold 0 and 1: took 1 as full coverage.", folder)
        alphas *= _OPAQUE
    return Masks(alphas=alphas, origin="files", note=f"Masks: {len(files)} files from {folder}.")


def _read_mask(file: Path, frames: Frames, index: int) -> np.ndarray:
    """Return the coverage of one frame; the file's alpha if it has one, else its brightness."""
    height_px, width_px = frames.alphas.shape[1:]
    picture = read_image(file)
    has_alpha = bool((picture.alpha < _OPAQUE).any())
    coverage = picture.alpha if has_alpha else picture.rgb.max(axis=2)
    _require_shape(picture, file, frames.names[index], (width_px, height_px))
    if picture.size_px == (width_px, height_px):
        return coverage
    import cv2

    shrinks = picture.size_px[0] > width_px
    filter_kind = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return cv2.resize(coverage, (width_px, height_px), interpolation=filter_kind)


def _require_shape(
    picture: Picture, file: Path, frame_name: str, frame_size_px: tuple[int, int]
) -> None:
    aspect_ratio = np.divide(*picture.size_px) / np.divide(*frame_size_px)
    if abs(aspect_ratio - 1) > _ASPECT_TOLERANCE:
        raise InputError(
            f"{file}: the mask has {picture.size_px[0]}x{picture.size_px[1]} pixels, its frame "
            f"{frame_name} has {frame_size_px[0]}x{frame_size_px[1]}, another aspect ratio."
        )


def _automatic_masks(frames: Frames) -> Masks:
    masks = [object_mask(image) for image in frames.images]
    failed = np.array([mask is None for mask in masks])
    alphas = np.full_like(frames.alphas, _OPAQUE)
    for index, mask in enumerate(masks):
        if mask is not None:
            alphas[index] = mask
    advice = "give masks (--masks FOLDER, or images with alpha)"
    if failed.all():
        logger.warning(
            "No mask could be found: the images have no alpha and no plain background. "
            "The whole frame counts as the object, which costs accuracy; %s.",
            advice,
        )
        return Masks(alphas=alphas, origin="none", note="Masks: none, the whole frame is used.")
    _warn_about(frames, failed, f"show no plain background and are used whole; {advice}")
    found_count = int((~failed).sum())
    return Masks(
        alphas=alphas,
        origin="automatic",
        note=f"Masks: found automatically, by the background's color, in {found_count} of "
        f"{len(frames)} frames; look at them, and give --masks if they are wrong.",
    )
