"""How far away things are in each frame: maps of a depth camera or of a depth network."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from animator.errors import InputError
from animator.scene.companions import match_files, require_all, require_aspect, warn_about
from animator.types import Frames

_NOUN = "depth map"
_ARRAY_SUFFIXES = frozenset({".npy"})
_IMAGE_SUFFIXES = frozenset({".png", ".tif", ".tiff", ".pgm"})

_PILLOW_FORMATS = ("PNG", "TIFF", "PPM")
"""Only these decoders see the file: fewer ways in for a hostile one."""
_GRAY_MODES = frozenset({"L", "I;16", "I;16L", "I;16B", "I;16N", "I", "F"})
"""Pillow's names for one channel of 8 bits, 16 bits, 32 bits and floating point."""


def read_depth_maps(frames: Frames, folder: Path) -> np.ndarray:
    """Read one depth map a frame, at the frames' size.

    Args:
        frames: The frames; their maps are matched by file name or number.
        folder: Where the maps lie: `.npy`, or gray images of 8 or 16 bits or floating point.

    Returns:
        The values as they stand in the files, on whatever scale; NaN where they are zero, negative
        or not finite, which is how cameras and networks say that nothing is known. float32,
        shape (T, H, W).

    Raises:
        InputError: If maps are missing for some frames, have another shape, are no maps of one
            number a pixel, or are unreadable.
    """
    files = require_all(frames, folder, _match(frames, folder), noun=_NOUN)
    height_px, width_px = frames.images.shape[1:3]
    depths = np.empty((len(frames), height_px, width_px), np.float32)
    is_empty = np.zeros(len(frames), bool)
    for index, file in enumerate(files):
        values = _read_array(file) if file.suffix.lower() in _ARRAY_SUFFIXES else _read_gray(file)
        require_aspect(file, (values.shape[1], values.shape[0]), frames, index, noun=_NOUN)
        depths[index] = _resized(_known(values), width_px, height_px)
        is_empty[index] = np.isnan(depths[index]).all()
    warn_about(frames, is_empty, "have a depth map without any value above zero")
    return depths


def _match(frames: Frames, folder: Path) -> list[Path | None]:
    """Find the file of each frame; an array wins over an image, often a picture of the same map."""
    arrays, images = (
        match_files(frames, folder, suffixes, noun=_NOUN, flag="--depth")
        for suffixes in (_ARRAY_SUFFIXES, _IMAGE_SUFFIXES)
    )
    return [array or image for array, image in zip(arrays, images, strict=True)]


def _read_array(file: Path) -> np.ndarray:
    """Open a `.npy` file of any real type, shape (H', W')."""
    try:
        # Mapped, so that what is refused below is never read.
        values = np.load(file, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # numpy raises half a dozen types on damaged headers
        raise InputError(
            f"{file}: expected one array of real numbers, but it cannot be read ({error}); "
            "save the map with numpy.save, one a file."
        ) from error
    if not isinstance(values, np.ndarray):
        values.close()
        raise InputError(
            f"{file}: expected one array, found an archive of several (.npz); save the map with "
            "numpy.save, one a file."
        )
    if values.ndim != 2 or values.dtype.kind not in "iuf" or values.size == 0:
        raise InputError(
            f"{file}: expected a 2-D array of real numbers, shape (height, width), found "
            f"{values.dtype} of shape {values.shape}; save one number a pixel, one map a file."
        )
    return np.asarray(values)


def _read_gray(file: Path) -> np.ndarray:
    """Decode a gray image with all its bits, EXIF rotation applied, shape (H', W')."""
    try:
        with Image.open(file, formats=_PILLOW_FORMATS) as image:
            mode = image.mode
            values = np.asarray(ImageOps.exif_transpose(image)) if mode in _GRAY_MODES else None
    except Exception as error:  # Pillow's decoders raise a dozen types on damaged data
        raise InputError(
            f"{file}: expected a gray image, but it cannot be decoded ({error}); "
            "is the file cut off, or of another type than its name says?"
        ) from error
    if values is None:
        raise InputError(
            f"{file}: expected a gray image of 8 or 16 bits or floating point, found one of mode "
            f"{mode}; depth cannot be told from colors: save the map itself as gray, or as .npy."
        )
    return values


def _known(values: np.ndarray) -> np.ndarray:
    """Return positive, finite float32 values; NaN where there are none, shape (H', W')."""
    # What is too large for float32 becomes infinite, and so unknown.
    with np.errstate(over="ignore", invalid="ignore"):
        depth = values.astype(np.float32, order="C")
    depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
    return depth


def _resized(depth: np.ndarray, width_px: int, height_px: int) -> np.ndarray:
    if depth.shape == (height_px, width_px):
        return depth
    import cv2

    # A mean of near and far lies where there is nothing, and one with NaN is NaN.
    return cv2.resize(depth, (width_px, height_px), interpolation=cv2.INTER_NEAREST_EXACT)
