"""What an image matcher must do."""

import dataclasses
from typing import Protocol

import numpy as np

from animator.types import Matches


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class MaskedImage:
    """An image and where the object is in it."""

    rgb: np.ndarray
    """sRGB 0..255, uint8, shape (H, W, 3); anything outside the mask is ignored."""
    mask: np.ndarray
    """True on the object, bool, shape (H, W)."""

    @property
    def box_px(self) -> tuple[int, int, int, int]:
        """Bounding box of the mask: left, top, right, bottom, half open; all 0 if it is empty."""
        rows = np.flatnonzero(self.mask.any(axis=1))
        columns = np.flatnonzero(self.mask.any(axis=0))
        if rows.size == 0:
            return 0, 0, 0, 0
        return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1

    @property
    def object_size_px(self) -> float:
        """Diagonal of the mask's bounding box [px], 0 if it is empty; the unit of tolerances."""
        left, top, right, bottom = self.box_px
        return float(np.hypot(right - left, bottom - top))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FlowField:
    """Dense motion from a source image to a target image, with its trust."""

    flow_px: np.ndarray
    """Displacement of each source pixel [px], float32, shape (H, W, 2)."""
    confidences: np.ndarray
    """Trust 0..1 of each pixel, 0 where rejected or outside the masks, float32, shape (H, W)."""
    matcher: str = ""
    """Name of the matcher that made it, for logs and reports."""

    def trusted_share(self, source_mask: np.ndarray) -> float:
        """Return the share of the source's object pixels that are trusted, 0..1."""
        count = np.count_nonzero(source_mask)
        return float(np.count_nonzero(self.confidences[source_mask]) / count) if count else 0.0


class Matcher(Protocol):
    """Finds where the object's pixels went."""

    def flow(self, source: MaskedImage, target: MaskedImage) -> FlowField:
        """Match densely: every trusted source pixel gets a displacement."""
        ...

    def match(self, source: MaskedImage, target: MaskedImage) -> Matches:
        """Match sparsely or on a grid: trusted pixel pairs only."""
        ...
