"""Pixels of a frame that the render does not explain: where something is lost, or has come out."""

import dataclasses

import cv2
import numpy as np
import torch

UNEXPLAINED = 0.25
"""Difference of color plus coverage, 0..2, above which a pixel is unexplained."""
_BLUR_PX = 3
"""Differences are averaged over so many pixels, so that a thin seam is no unexplained region."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class CoveredImage:
    """An image on black with its coverage."""

    rgb: np.ndarray
    """Color times coverage, 0..1, shape (H, W, 3)."""
    alpha: np.ndarray
    """Coverage 0..1, shape (H, W)."""

    @classmethod
    def of(cls, rgb: torch.Tensor, alpha: torch.Tensor) -> "CoveredImage":
        """Take a render or a frame off its device. Shapes (H, W, 3) and (H, W)."""
        return cls(rgb=rgb.detach().cpu().numpy(), alpha=alpha.detach().cpu().numpy())

    @property
    def is_covered(self) -> np.ndarray:
        """Where the object is, bool, shape (H, W)."""
        return self.alpha > 0.5


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Piece:
    """A connected piece of the object in a frame."""

    share: float
    """Of the object's silhouette, 0..1."""
    middle_px: np.ndarray
    """Its middle in the frame, x and y, pixel centers at +0.5 [px], float64, shape (2,)."""


def unexplained_pixels(render: CoveredImage, frame: CoveredImage, *, error: float) -> np.ndarray:
    """Find where a render differs from a frame, bool, shape (H, W).

    Args:
        render: What was drawn.
        frame: What it should look like.
        error: Difference of color plus coverage, 0..2, above which a pixel is unexplained.
    """
    difference = np.abs(render.rgb - frame.rgb).mean(axis=-1) + np.abs(render.alpha - frame.alpha)
    return cv2.blur(difference, (_BLUR_PX, _BLUR_PX)) > error


def largest_unexplained_piece(
    render: CoveredImage, frame: CoveredImage, *, error: float, thinnest_px: float
) -> Piece | None:
    """Find the largest connected piece of the object that the render does not explain.

    Edges that are a little off make long, thin pieces; what is thin does not count.

    Args:
        render: What was drawn.
        frame: What it should look like.
        error: Difference above which a pixel is unexplained.
        thinnest_px: Width below which a piece is thin [px].

    Returns:
        The piece; None if all is explained.
    """
    pieces = unexplained_pixels(render, frame, error=error) & frame.is_covered
    width = 2 * round(thinnest_px / 2) + 1
    disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    thick = cv2.morphologyEx(pieces.astype(np.uint8), cv2.MORPH_OPEN, disk)
    _, _, stats, middles = cv2.connectedComponentsWithStats(thick)
    areas = stats[1:, cv2.CC_STAT_AREA]
    if len(areas) == 0:
        return None
    largest = int(areas.argmax())
    return Piece(
        share=float(areas[largest] / frame.is_covered.sum()), middle_px=middles[1 + largest] + 0.5
    )
