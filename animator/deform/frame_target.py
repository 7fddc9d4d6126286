"""What one frame asks of a pose."""

import dataclasses

import numpy as np
import torch

from animator.deform.image_difference import ImageOnBlack
from animator.types import Camera, GaussianDepths, GaussianMatches


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FrameTarget:
    """What one frame shows."""

    image: ImageOnBlack
    """The frame, possibly cropped."""
    camera: Camera
    """The camera of this image."""
    matches: GaussianMatches | None
    """Where matched Gaussians were seen, in this camera's pixels."""
    object_px: float
    """Size of the object in the image [px]."""
    depths: GaussianDepths | None = None
    """How far visible Gaussians are, if the user gave depth maps."""
    counted: torch.Tensor | None = None
    """Pixels that count, 1 or 0, shape (H, W); None for all of them."""

    def limited_to(self, counted: torch.Tensor) -> "FrameTarget":
        """Return what only some pixels show: 1 or 0 each, shape (H, W). Depths are kept."""
        matches = self.matches
        if matches is not None:
            height, width = counted.shape
            x, y = np.floor(matches.target_px).astype(np.int64).T
            kept = counted.cpu().numpy()[y.clip(0, height - 1), x.clip(0, width - 1)] > 0
            matches = matches.take(kept)
        return dataclasses.replace(
            self, image=self.image.where(counted), matches=matches, counted=counted
        )
