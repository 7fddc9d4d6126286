"""Sketches of frames: half the size, fewer Gaussians; enough to tell which of many starts leads somewhere."""

import torch

from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import ImageSolver
from animator.deform.thinning import thinned
from animator.render.protocol import Renderer
from animator.sequence.bare_solver import BareSolver
from animator.sequence.target import halved
from animator.sequence.view_colors import ViewColors
from animator.types import AnchorPoses, Anchors, Camera, Gaussians


class Sketch:
    """One frame, and a solver for it."""

    def __init__(self, target: FrameTarget, solver: BareSolver) -> None:
        self._target = target
        self._solver = solver

    def solve(self, start: AnchorPoses, steps: int) -> AnchorPoses:
        """Descend from a start for so many steps at most; what comes out is right across the rays, not along them."""
        return self._solver.solve(self._target, start, most_steps=steps)

    def energy(self, poses: AnchorPoses) -> float:
        """Evaluate what `solve` minimizes; to be compared within one sketch only."""
        return self._solver.energy(self._target, poses)


class Sketcher:
    """Sketches the frames of one clip, with `most_gaussians` of its Gaussians at most."""

    def __init__(
        self,
        image_solver: ImageSolver,
        anchors: Anchors,
        renderer: Renderer,
        colors: ViewColors,
        *,
        most_gaussians: int = 5000,
    ) -> None:
        self._image_solver = image_solver
        self._anchors = anchors
        self._renderer = renderer
        self._colors = colors
        self._most_gaussians = most_gaussians

    def sketch(self, target: FrameTarget) -> Sketch:
        """Sketch a frame, in the colors of the present view."""

        def draw(gaussians: Gaussians, camera: Camera) -> tuple[torch.Tensor, torch.Tensor]:
            rendering = self._renderer.render(gaussians, camera)
            return rendering.rgb, rendering.alpha

        painted = self._colors.paint_as_seen(self._image_solver.gaussians)
        gaussians, anchors = thinned(painted, self._anchors, self._most_gaussians)
        solver = ImageSolver(gaussians, anchors, draw, self._image_solver.config)
        return Sketch(halved(target), BareSolver(solver))
