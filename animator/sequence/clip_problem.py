"""What the driver works on."""

import dataclasses

from animator.match.protocol import Matcher
from animator.render.protocol import Renderer
from animator.types import Anchors, Camera, Frames, Gaussians


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ClipProblem:
    """A clip to solve, with the tools for it."""

    gaussians: Gaussians
    """The rest pose, on the renderer's device."""
    anchors: Anchors
    frames: Frames
    cameras: tuple[Camera, ...]
    """One camera a frame."""
    renderer: Renderer
    matcher: Matcher
    seed: int
    follow_camera: bool = False
    """Re-estimate the camera of every frame from the previous one: it moves, and no file says how."""
