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


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FlowField:
    """Dense motion from a source image to a target image, with its trust."""

    flow_px: np.ndarray
    """Displacement of each source pixel [px], float32, shape (H, W, 2)."""
    confidences: np.ndarray
    """Trust 0..1 at each source pixel, 0 where rejected or outside the masks, float32, shape (H, W)."""


class Matcher(Protocol):
    """Finds where the object's pixels went."""

    def flow(self, source: MaskedImage, target: MaskedImage) -> FlowField:
        """Match densely: every trusted source pixel gets a displacement."""
        ...

    def match(self, source: MaskedImage, target: MaskedImage) -> Matches:
        """Match sparsely or on a grid: trusted pixel pairs only."""
        ...
