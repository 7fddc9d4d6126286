"""How much a drawn image differs from the frame: color, coverage, and both over cells, in one pass.

The sum of `rgb_loss`, `silhouette_loss` and `coarse_image_loss` of `losses.py`, which say what it means. It is asked
for in every step of the image stage, and on CPUs torch would take as long for it as the renderer for its image.
"""

import dataclasses
import functools
from typing import Any

import numpy as np
import torch
from numba import prange

from animator.deform import losses
from animator.jit.kernel import RELAXED, kernel

_CELLS_PX = (4, 10)
_CHANNELS = 4
_ZERO = np.float32(0.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImageWeights:
    """Weights of the three terms; zero switches a term off."""

    rgb: float
    silhouette: float
    coarse: float


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ImageOnBlack:
    """A render or a frame, composited on black."""

    rgb: torch.Tensor
    """Color times coverage, 0..1, shape (H, W, 3)."""
    alpha: torch.Tensor
    """Coverage 0..1, shape (H, W)."""

    def where(self, counted: torch.Tensor) -> "ImageOnBlack":
        """Return the image with black in the pixels that do not count; 1 or 0 each, shape (H, W)."""
        return ImageOnBlack(rgb=self.rgb * counted[..., None], alpha=self.alpha * counted)

    @functools.cached_property
    def area_px(self) -> float:
        """Area of the silhouette [px], at least 1."""
        return max(float((self.alpha > 0.5).sum()), 1.0)


def image_difference(
    drawn: ImageOnBlack, target: ImageOnBlack, weights: ImageWeights
) -> torch.Tensor:
    """Compare two images, differentiable in the drawn one.

    Args:
        drawn: The render.
        target: The frame; the terms are divided by the area of its silhouette.
        weights: Weights of the terms.

    Returns:
        The weighted sum of the terms, a scalar.
    """
    area_px = target.area_px
    if drawn.rgb.device.type == "cpu":
        difference = _Difference.apply(drawn.rgb, drawn.alpha, target, weights)
        return difference  # type: ignore[return-value]
    total = weights.rgb * losses.rgb_loss(drawn.rgb, target.rgb, area_px=area_px)
    total = total + weights.silhouette * losses.silhouette_loss(
        drawn.alpha, target.alpha, area_px=area_px
    )
    if weights.coarse > 0:
        differences = torch.cat(
            [drawn.rgb - target.rgb, (drawn.alpha - target.alpha)[..., None]], dim=-1
        )
        total = total + weights.coarse * losses.coarse_image_loss(
            differences, area_px=area_px, cells_px=_CELLS_PX
        )
    return total


class _Difference(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        rgb: torch.Tensor,
        alpha: torch.Tensor,
        target: ImageOnBlack,
        weights: ImageWeights,
    ) -> torch.Tensor:
        area_px = target.area_px
        # By channel: color, coverage. A cell's mean counts as if the whole cell were inside.
        fine = np.array([weights.rgb / 3.0] * 3 + [weights.silhouette]) / area_px
        coarse = np.float32(weights.coarse / (3.0 * area_px))
        differences = np.empty((*alpha.shape, _CHANNELS), np.float32)
        slopes = np.empty(rgb.shape, np.float32), np.empty(alpha.shape, np.float32)
        images = [_array(image) for image in (rgb, alpha, target.rgb, target.alpha)]
        total = _compare(*images, fine.astype(np.float32), differences, slopes)
        if weights.coarse > 0:
            for cell in _CELLS_PX:
                total += _compare_cells(differences, cell, coarse, slopes)
        ctx.slopes = slopes
        return torch.tensor(total, dtype=rgb.dtype)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> Any:
        by_rgb, by_alpha = (torch.from_numpy(slopes) * gradients[0] for slopes in ctx.slopes)
        return by_rgb, by_alpha, None, None


def _array(image: torch.Tensor) -> np.ndarray:
    return image.detach().float().contiguous().numpy()


@kernel(parallel=True, fastmath=RELAXED)
def _compare(rgb, alpha, target_rgb, target_alpha, weights, differences, slopes):
    """Fill differences and slopes of the terms by pixel; return the terms' sum."""
    by_rgb, by_alpha = slopes
    sums = np.zeros(alpha.shape[0])
    for y in prange(alpha.shape[0]):
        total = np.float32(0.0)
        for x in range(alpha.shape[1]):
            for c in range(3):
                difference = rgb[y, x, c] - target_rgb[y, x, c]
                differences[y, x, c] = difference
                by_rgb[y, x, c] = weights[c] * np.sign(difference)
                total += weights[c] * abs(difference)
            difference = alpha[y, x] - target_alpha[y, x]
            differences[y, x, 3] = difference
            by_alpha[y, x] = weights[3] * np.sign(difference)
            total += weights[3] * abs(difference)
        sums[y] = total
    return sums.sum()


@kernel(parallel=True, fastmath=RELAXED)
def _compare_cells(differences, cell, weight, slopes):
    """Add the slopes of the terms by cell; return the terms' sum."""
    by_rgb, by_alpha = slopes
    height, width, _ = differences.shape
    sums = np.zeros((height + cell - 1) // cell)
    for row in prange(len(sums)):
        top, bottom = row * cell, min((row + 1) * cell, height)
        for left in range(0, width, cell):
            right = min(left + cell, width)
            red, green, blue, cover = _ZERO, _ZERO, _ZERO, _ZERO
            for y in range(top, bottom):
                for x in range(left, right):
                    red += differences[y, x, 0]
                    green += differences[y, x, 1]
                    blue += differences[y, x, 2]
                    cover += differences[y, x, 3]
            # Cells at the border are smaller, and count as if they were whole.
            scale = weight * np.float32(cell * cell / ((bottom - top) * (right - left)))
            sums[row] += scale * (abs(red) + abs(green) + abs(blue) + abs(cover))
            red, green = scale * np.sign(red), scale * np.sign(green)
            blue, cover = scale * np.sign(blue), scale * np.sign(cover)
            for y in range(top, bottom):
                for x in range(left, right):
                    by_rgb[y, x, 0] += red
                    by_rgb[y, x, 1] += green
                    by_rgb[y, x, 2] += blue
                    by_alpha[y, x] += cover
    return sums.sum()
