"""Where the object is in each frame: from alpha, from mask files, or found automatically."""

import dataclasses
import logging
from pathlib import Path
from typing import Literal

import numpy as np

from animator.scene.border_background import object_mask
from animator.scene.companions import match_files, require_all, require_aspect, warn_about
from animator.scene.image_file import IMAGE_SUFFIXES, read_image
from animator.types import Frames

logger = logging.getLogger(__name__)

_NOUN = "mask"
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
        return _masks_from_files(frames, folder, _match(frames, folder))
    if (frames.alphas < _OPAQUE).any():
        return _masks_from_alpha(frames)
    if folder is not None:
        files = _match(frames, folder)
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
    warn_about(frames, coverage.min(axis=1) == _OPAQUE, "are opaque all over, unlike the others")
    warn_about(frames, coverage.max(axis=1) == 0, "are wholly transparent: nothing to see there")
    return Masks(alphas=frames.alphas, origin="alpha", note="Masks: the images' alpha.")


def _match(frames: Frames, folder: Path) -> list[Path | None]:
    return match_files(frames, folder, IMAGE_SUFFIXES, noun=_NOUN, flag="--masks")


def _masks_from_files(frames: Frames, folder: Path, files: list[Path | None]) -> Masks:
    alphas = np.empty_like(frames.alphas)
    largest = 0
    for index, file in enumerate(require_all(frames, folder, files, noun=_NOUN)):
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
    require_aspect(file, picture.size_px, frames, index, noun=_NOUN)
    if picture.size_px == (width_px, height_px):
        return coverage
    import cv2

    shrinks = picture.size_px[0] > width_px
    filter_kind = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return cv2.resize(coverage, (width_px, height_px), interpolation=filter_kind)


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
    warn_about(frames, failed, f"show no plain background and are used whole; {advice}")
    found_count = int((~failed).sum())
    return Masks(
        alphas=alphas,
        origin="automatic",
        note=f"Masks: found automatically, by the background's color, in {found_count} of "
        f"{len(frames)} frames; look at them, and give --masks if they are wrong.",
    )
