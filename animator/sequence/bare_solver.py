"""The image solver on what a target says alone: no rigid groups, no frame before, no matches but its own.

That is what poses from different origins are compared by, and solved again with.
"""

import torch

from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import ImageSolver, ImageSolverConfig
from animator.deform.smooth_field import SmoothField
from animator.types import AnchorPoses


class BareSolver:
    """Solves and judges poses of one clip."""

    def __init__(self, image_solver: ImageSolver) -> None:
        self._image_solver = image_solver

    @property
    def config(self) -> ImageSolverConfig:
        """How it solves."""
        return self._image_solver.config

    def with_config(self, config: ImageSolverConfig) -> "BareSolver":
        """Return a solver of the same clip that solves otherwise."""
        return BareSolver(self._image_solver.with_config(config))

    def energy(self, target: FrameTarget, poses: AnchorPoses) -> float:
        """Evaluate what `solve` minimizes."""
        return self._image_solver.energy(poses, target, poses)

    def solve(
        self, target: FrameTarget, start: AnchorPoses, *, most_steps: int | None = None
    ) -> AnchorPoses:
        """Run the image stage of a frame from a start, for so many steps at most."""
        return self._image_solver.solve(target, start, start, most_steps=most_steps)

    def solve_smoothly(
        self, field: SmoothField, target: FrameTarget, start: AnchorPoses
    ) -> AnchorPoses:
        """Find the pose of a smooth field that costs least, from near a start."""
        return field.solve(self._image_solver, target, start)

    def image_loss(self, target: FrameTarget, poses: AnchorPoses) -> float:
        """Measure how badly a pose explains what a target shows."""
        with torch.no_grad():
            return float(self._image_solver.image_loss(self._image_solver.pose(poses), target))

    def is_clearly_better(
        self, target: FrameTarget, one: AnchorPoses, own: AnchorPoses, gain: float
    ) -> bool:
        """Tell whether a solved pose saves a share of the energy of a frame's own.

        Any pose gets better from being solved for longer. So the own one is solved again, too, and what counts is
        what is saved then.

        Args:
            target: The frame.
            one: The other pose, just solved.
            own: The frame's pose so far.
            gain: The share.
        """
        enough = self.energy(target, one) / (1.0 - gain)
        if self.energy(target, own) < enough:
            return False
        return self.energy(target, self.solve(target, own)) >= enough
