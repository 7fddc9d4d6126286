"""How much a drawn image differs from the frame: color, coverage, and both over cells, in one pass.

The sum of `rgb_loss`, `silhouette_loss` and `coarse_image_loss` of `losses.py`, which say what it means. It is asked
for in every step of the image stage, and on CPUs torch would take as long for it as the renderer for its image.
"""

import dataclasses
import functools
from typing import Any

import numpy as np
import torch

from animator.deform import losses
from animator.jit.kernel import RELAXED, kernel

_CELLS_PX = (4, 10)
_CHANNELS = 4


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
        slopes = np.empty_like(differences)
        images = [_array(image) for image in (rgb, alpha, target.rgb, target.alpha)]
        total = _compare(*images, fine.astype(np.float32), differences, slopes)
        if weights.coarse > 0:
            for cell in _CELLS_PX:
                total += _compare_cells(differences, cell, coarse, slopes)
        ctx.slopes = slopes
        return torch.tensor(total, dtype=rgb.dtype)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> Any:
        slopes = torch.from_numpy(ctx.slopes) * gradients[0]
        return slopes[..., :3], slopes[..., 3], None, None


def _array(image: torch.Tensor) -> np.ndarray:
    return image.detach().float().contiguous().numpy()


@kernel(fastmath=RELAXED)
def _compare(rgb, alpha, target_rgb, target_alpha, weights, differences, slopes):
    """Fill differences and slopes of the terms by pixel; return the terms' sum."""
    total = 0.0
    for y in range(alpha.shape[0]):
        for x in range(alpha.shape[1]):
            for c in range(3):
                differences[y, x, c] = rgb[y, x, c] - target_rgb[y, x, c]
            differences[y, x, 3] = alpha[y, x] - target_alpha[y, x]
            for c in range(4):
                total += weights[c] * abs(differences[y, x, c])
                slopes[y, x, c] = weights[c] * np.sign(differences[y, x, c])
    return total


@kernel(fastmath=RELAXED)
def _compare_cells(differences, cell, weight, slopes):
    """Add the slopes of the terms by cell; return the terms' sum."""
    height, width, _ = differences.shape
    total = 0.0
    sums, step = np.empty(4, np.float32), np.empty(4, np.float32)
    for top in range(0, height, cell):
        bottom = min(top + cell, height)
        for left in range(0, width, cell):
            right = min(left + cell, width)
            sums[:] = 0.0
            for y in range(top, bottom):
                for x in range(left, right):
                    for c in range(4):
                        sums[c] += differences[y, x, c]
            # Cells at the border are smaller, and count as if they were whole.
            scale = weight * np.float32(cell * cell / ((bottom - top) * (right - left)))
            for c in range(4):
                total += scale * abs(sums[c])
                step[c] = scale * np.sign(sums[c])
            for y in range(top, bottom):
                for x in range(left, right):
                    for c in range(4):
                        slopes[y, x, c] += step[c]
    return total
