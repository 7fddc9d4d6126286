"""What one frame asks of a pose."""

import dataclasses

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
