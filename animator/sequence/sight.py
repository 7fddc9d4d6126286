"""The frames of one clip, and the Gaussians drawn to compare with them."""

import torch

from animator.deform.frame_target import FrameTarget
from animator.deform.shading import Shading
from animator.match.protocol import MaskedImage
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.target import FrameView, Window, crop_window, masked_render
from animator.sequence.view_colors import ViewColors
from animator.types import Camera, Gaussians


class Sight:
    """Looks at frames and draws Gaussians in the colors of the view that was looked at last."""

    def __init__(self, problem: ClipProblem) -> None:
        self._renderer = problem.renderer
        self.shading = Shading(problem.gaussians)
        self.colors = ViewColors(self.shading)
        self.views = [FrameView.read(problem.frames, index) for index in range(len(problem.frames))]

    def draw(self, gaussians: Gaussians, camera: Camera) -> tuple[torch.Tensor, torch.Tensor]:
        """Draw color and alpha on black."""
        rendering = self._renderer.render(self.colors.paint(gaussians), camera)
        return rendering.rgb, rendering.alpha

    def look(self, index: int, posed: Gaussians, camera: Camera) -> tuple[Window, FrameTarget]:
        """Look at a frame in the colors of a pose: crop it to where the pose and the object are."""
        self.colors.look(posed, camera)
        view = self.views[index]
        window = crop_window(view, self.draw(posed, camera)[1], camera)
        return window, view.target(window, camera, self._renderer.device)

    def render(self, posed: Gaussians, camera: Camera) -> MaskedImage:
        """Draw a pose as an image for matching."""
        return masked_render(*self.draw(posed, camera))
