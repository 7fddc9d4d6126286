"""Image pairs whose motion is known exactly, because the texture is a formula read at two places."""

import dataclasses
import functools
from collections.abc import Callable

import numpy as np

from animator.match.protocol import FlowField, MaskedImage

SIDE_PX = 256


@dataclasses.dataclass(frozen=True, kw_only=True)
class Affine:
    """x -> linear x + shift about the image's center, in +0.5 pixels."""

    angle_deg: float = 0.0
    scale: float = 1.0
    shift_px: tuple[float, float] = (0.0, 0.0)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        angle = np.radians(self.angle_deg)
        linear = self.scale * np.array(
            [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        )
        center = SIDE_PX / 2
        return (points - center) @ linear.T + center + np.array(self.shift_px)

    def inverse(self, points: np.ndarray) -> np.ndarray:
        angle = np.radians(-self.angle_deg)
        linear = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        center = SIDE_PX / 2
        return (points - center - np.array(self.shift_px)) @ linear.T / self.scale + center


def centers() -> np.ndarray:
    """Return all pixel centers, shape (H, W, 2), without the code under test."""
    rows, columns = np.mgrid[0:SIDE_PX, 0:SIDE_PX]
    return np.stack([columns + 0.5, rows + 0.5], axis=-1)


class Texture:
    """A sum of random waves: smooth, never repeating, and readable at any position."""

    def __init__(self, seed: int, wave_count: int = 24):
        rng = np.random.default_rng(seed)
        lengths_px = np.exp(rng.uniform(np.log(6), np.log(60), wave_count))
        directions = rng.uniform(0, 2 * np.pi, wave_count)
        self._frequencies = (
            2 * np.pi / lengths_px[:, None] * np.stack([np.cos(directions), np.sin(directions)], -1)
        )
        self._phases = rng.uniform(0, 2 * np.pi, wave_count)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return RGB 0..255 as floats, shape (..., 3)."""
        total = np.zeros(points.shape[:-1])
        for (along_x, along_y), phase in zip(self._frequencies, self._phases, strict=True):
            total += np.sin(along_x * points[..., 0] + along_y * points[..., 1] + phase)
        gray = 128 + 90 * total / np.sqrt(len(self._phases))
        return np.clip(gray[..., None] * np.array([1.0, 0.9, 0.8]), 0, 255)


def disk(center: tuple[float, float], radius_px: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return a test of points for membership in a disk."""
    return lambda points: np.linalg.norm(points - np.array(center), axis=-1) < radius_px


@functools.cache
def moved_pair(
    motion: Affine,
    *,
    seed: int = 0,
    radius_px: float = 80.0,
    center: tuple[float, float] = (128.0, 128.0),
) -> tuple[MaskedImage, MaskedImage]:
    """Return a textured disk before and after a motion; the target is a little brighter."""
    texture, shape = Texture(seed), disk(center, radius_px)
    here, origin = centers(), motion.inverse(centers())
    source = image_of(texture(here), shape(here))
    target = image_of(0.9 * texture(origin) + 20, shape(origin))
    return source, target


def image_of(rgb: np.ndarray, mask: np.ndarray) -> MaskedImage:
    """Round to bytes; a checkerboard off the object would spoil any matcher that looks there."""
    rows, columns = np.mgrid[0 : mask.shape[0], 0 : mask.shape[1]]
    board = np.where((rows // 7 + columns // 7) % 2, 255, 0)[..., None]
    pixels = np.where(mask[..., None], np.rint(rgb), board).astype(np.uint8)
    return MaskedImage(rgb=pixels, mask=mask)


def flow_errors(flow: FlowField, motion: Affine) -> np.ndarray:
    """Return the distance of each trusted displacement from the truth [px]."""
    here = centers()
    errors = np.linalg.norm(here + flow.flow_px - motion(here), axis=-1)
    return errors[flow.confidences > 0]
