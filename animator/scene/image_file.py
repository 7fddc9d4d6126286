"""Decode one image file to 8-bit RGB with straight alpha."""

import dataclasses
from pathlib import Path

import numpy as np
from PIL import ExifTags, Image, ImageOps

from animator.errors import InputError

IMAGE_SUFFIXES = frozenset(
    {".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff", ".tga", ".ppm", ".pgm"}
)
"""File name endings that are read as images, lower case."""

_PILLOW_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TIFF", "TGA", "PPM")
"""Only these decoders see the file: fewer ways in for a hostile one."""
_SIDEWAYS_ORIENTATIONS = (5, 6, 7, 8)
"""EXIF orientations that swap width and height (CIPA DC-008, tag 0x0112)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """One decoded image."""

    rgb: np.ndarray
    """sRGB, straight, uint8, shape (H, W, 3)."""
    alpha: np.ndarray
    """Coverage, 255 if the file has none, uint8, shape (H, W)."""
    name: str
    """File name, for messages."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.rgb.shape[1], self.rgb.shape[0]

    def resized(self, width_px: int, height_px: int) -> "Picture":
        """Return the picture averaged down to a smaller size.

        Colors are averaged by their coverage, so that what lies hidden under transparent pixels
        does not bleed into the edge.
        """
        import cv2

        size_px = (width_px, height_px)
        plain = cv2.resize(self.rgb, size_px, interpolation=cv2.INTER_AREA)
        if self.alpha.min() == 255:
            return dataclasses.replace(
                self, rgb=plain, alpha=np.full((height_px, width_px), 255, np.uint8)
            )
        coverage = self.alpha.astype(np.float32)[..., None] / 255
        covered = cv2.resize(self.rgb * coverage, size_px, interpolation=cv2.INTER_AREA)
        alpha = cv2.resize(coverage, size_px, interpolation=cv2.INTER_AREA)
        is_seen = alpha[..., None] > 0
        rgb = np.where(is_seen, covered / np.where(is_seen, alpha[..., None], 1), plain)
        return dataclasses.replace(
            self,
            rgb=np.clip(np.rint(rgb), 0, 255).astype(np.uint8),
            alpha=np.rint(alpha * 255).astype(np.uint8),
        )


def read_image(path: Path) -> Picture:
    """Decode an image file.

    Gray becomes RGB, 16 bits become 8, palettes and transparent colors become alpha, and the EXIF
    rotation is applied. Color profiles are ignored: the values are taken as sRGB.

    Raises:
        InputError: If it cannot be decoded, or has floating-point pixels.
    """
    try:
        with Image.open(path, formats=_PILLOW_FORMATS) as file:
            image = ImageOps.exif_transpose(file)
            if image.mode == "F":
                raise InputError(
                    f"{path}: expected 8 or 16 bits a channel, found floating-point pixels; "
                    "convert the images to PNG."
                )
            if image.mode.startswith("I"):
                image = Image.fromarray(_eight_bits(np.asarray(image)))
            rgba = np.asarray(image.convert("RGBA"))
    except InputError:
        raise
    except Exception as error:  # Pillow's decoders raise a dozen types on damaged data
        raise _unreadable(path, error) from error
    return Picture(
        rgb=np.ascontiguousarray(rgba[..., :3]),
        alpha=np.ascontiguousarray(rgba[..., 3]),
        name=path.name,
    )


def image_size_px(path: Path) -> tuple[int, int]:
    """Return width and height [px] after the EXIF rotation, without decoding the pixels.

    Raises:
        InputError: If it is no image.
    """
    try:
        with Image.open(path, formats=_PILLOW_FORMATS) as file:
            width_px, height_px = file.size
            is_sideways = file.getexif().get(ExifTags.Base.Orientation) in _SIDEWAYS_ORIENTATIONS
    except Exception as error:  # see read_image
        raise _unreadable(path, error) from error
    return (height_px, width_px) if is_sideways else (width_px, height_px)


def _eight_bits(gray: np.ndarray) -> np.ndarray:
    """Bring 16-bit gray to 8 bits; the high byte, as Pillow itself does for 16-bit color."""
    return np.clip(gray.astype(np.int64) >> 8, 0, 255).astype(np.uint8)


def _unreadable(path: Path, error: Exception) -> InputError:
    return InputError(
        f"{path}: expected an image, but it cannot be decoded ({error}); "
        "is the file cut off, or of another type than its name says?"
    )
