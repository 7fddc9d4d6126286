"""The image stage of one frame: preconditioned Adam on the anchor transformations (paper Sec. 3.4).

Raw per-anchor Adam moves every anchor by itself and lags behind fast motion. Here the unknowns pass through a
Laplacian smoother of the anchor graph, P = (I + s L)^-1, so that a step moves a neighborhood together
(Sobolev preconditioning; the minimum is unchanged because P is invertible). What moves farther together has
unknowns of its own (`coarse_motion.py`).
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import torch

from animator import quaternions
from animator.deform import losses
from animator.deform.anchors import distances_between
from animator.deform.coarse_motion import CoarseConfig, NodeLevel, NodeMotion
from animator.deform.frame_target import FrameTarget
from animator.deform.image_difference import ImageOnBlack, ImageWeights, image_difference
from animator.deform.pace import Pace, PaceConfig, descend
from animator.deform.robust_norm import RobustNorm
from animator.deform.skinning import Skinner
from animator.types import (
    AnchorPoses,
    Anchors,
    Camera,
    GaussianDepths,
    Gaussians,
)

Draw = Callable[[Gaussians, Camera], tuple[torch.Tensor, torch.Tensor]]
"""Renders color (H, W, 3) and alpha (H, W) over black."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class LossWeights:
    """Weights of the terms of Eq. 7 and of ours; zero switches a term off."""

    deform: float = 0.3
    """Matched Gaussians to their pixels (Eq. 3)."""
    depth: float = 3.0
    """Visible Gaussians to the depths that the user's maps say, where there are any."""
    group: float = 200.0
    """Rigid groups stay rigid (Eq. 4)."""
    arap: float = 2000.0
    """Neighboring anchors move as rigidly as possible (Eq. 5)."""
    rotation: float = 5.0
    """Neighboring anchors turn alike."""
    rgb: float = 1.0
    """Color (Eq. 6)."""
    silhouette: float = 0.3
    """Coverage."""
    coarse_image: float = 0.5
    """Color and coverage averaged over cells."""
    temporal: float = 0.0
    """Nearness to the previous frame; off, for the warm start holds what the frame does not move."""
    rest: float = 60.0
    """What hardly moved stays where it was captured."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImageSolverConfig:
    """The optimizer of the image stage."""

    turn_rate: float = 1.6e-2
    """Learning rate of the quaternions."""
    shift_rate: float = 4e-3
    """Learning rate of the translations [diagonals]."""
    pace: PaceConfig = dataclasses.field(default_factory=PaceConfig)
    """How many Adam steps a frame gets."""
    smoothing: float = 4.0
    """Strength s of the preconditioner; 0 is plain Adam."""
    coarse: CoarseConfig = dataclasses.field(default_factory=CoarseConfig)
    """Unknowns that move many anchors at once."""
    arap_norm: RobustNorm = RobustNorm(reach=0.004, floor=0.1)
    """What the residuals of Eq. 5 cost [diagonals]."""
    turn_norm: RobustNorm = RobustNorm(reach=0.1)
    """What |R_i - R_j| of neighboring anchors costs; 0.1 is 4 degrees."""
    rest_norm: RobustNorm = RobustNorm(reach=0.01)
    """What motion from rest costs [diagonals]."""
    weights: LossWeights = dataclasses.field(default_factory=LossWeights)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class RigidPairs:
    """Pairs of Gaussians that belong to one rigid group."""

    first: torch.Tensor
    """Indices of Gaussians i, int64, shape (P,)."""
    second: torch.Tensor
    """Indices of Gaussians j, int64, shape (P,)."""


class ImageSolver:
    """Solves frame after frame for one clip; holds only what is constant over the clip."""

    def __init__(
        self, gaussians: Gaussians, anchors: Anchors, draw: Draw, config: ImageSolverConfig
    ) -> None:
        self.gaussians = gaussians
        self._anchors = anchors
        self._draw = draw
        self.config = config
        self._diagonal = gaussians.diagonal
        self._image_weights = ImageWeights(
            rgb=config.weights.rgb,
            silhouette=config.weights.silhouette,
            coarse=config.weights.coarse_image,
        )
        self._skinner = Skinner(anchors, gaussians.means, gaussians.quats_wxyz)
        self._smoother = _laplacian_smoother(anchors, config.smoothing)
        along = distances_between(anchors)
        self._levels = [
            NodeLevel(anchors, along, count, self._diagonal, config.coarse)
            for count in config.coarse.nodes
        ]

    def with_config(self, config: ImageSolverConfig) -> "ImageSolver":
        """Return a solver of the same clip that solves otherwise."""
        return ImageSolver(self.gaussians, self._anchors, self._draw, config)

    def pose(self, poses: AnchorPoses) -> Gaussians:
        """Skin the Gaussians to a pose (Eq. 2), differentiable in the pose."""
        return self.gaussians.posed(*self._skinner(poses))

    def image_error(self, poses: AnchorPoses, target: FrameTarget) -> float:
        """Measure how badly a pose explains the frame: RGB and silhouette terms, lower is better."""
        fine = dataclasses.replace(self._image_weights, coarse=0.0)
        with torch.no_grad():
            return float(self._difference(self.pose(poses), target, fine))

    def image_loss(self, posed: Gaussians, target: FrameTarget) -> torch.Tensor:
        """Sum the terms that compare drawn Gaussians with the frame, differentiable in them."""
        return self._difference(posed, target, self._image_weights)

    def match_loss(self, posed: Gaussians, target: FrameTarget) -> torch.Tensor:
        """Measure how far matched Gaussians are from their pixels (Eq. 3), differentiable in them.

        Zero without matches.
        """
        matches = target.matches
        if matches is None:
            return posed.means.new_zeros(())
        points = posed.means[torch.as_tensor(matches.gaussian_ids, device=posed.means.device)]
        return losses.deformation_loss(
            project(points, target.camera),
            torch.as_tensor(matches.target_px, dtype=points.dtype, device=points.device),
            torch.as_tensor(matches.confidences, dtype=points.dtype, device=points.device),
            object_px=target.object_px,
        )

    def _difference(
        self, posed: Gaussians, target: FrameTarget, weights: ImageWeights
    ) -> torch.Tensor:
        rgb, alpha = self._draw(posed, target.camera)
        drawn = ImageOnBlack(rgb=rgb, alpha=alpha)
        if target.counted is not None:
            drawn = drawn.where(target.counted)
        return image_difference(drawn, target.image, weights)

    def energy(self, poses: AnchorPoses, target: FrameTarget, previous: AnchorPoses) -> float:
        """Evaluate what `solve` minimizes, without rigid groups."""
        with torch.no_grad():
            return float(self.loss(poses, target, previous))

    def loss(self, poses: AnchorPoses, target: FrameTarget, previous: AnchorPoses) -> torch.Tensor:
        """Return what `solve` minimizes, without rigid groups, differentiable in the poses."""
        return self._total_loss(target, poses, self.pose(poses), previous, None)

    def solve(
        self,
        target: FrameTarget,
        start: AnchorPoses,
        previous: AnchorPoses,
        *,
        rigid_pairs: Callable[[int, Gaussians], RigidPairs | None] = lambda settled_steps, posed: (
            None
        ),
        most_steps: int | None = None,
    ) -> AnchorPoses:
        """Minimize the total loss (Eq. 7) from `start`.

        Args:
            target: The frame.
            start: Where the iteration begins.
            previous: The previous frame's pose, for the temporal term.
            rigid_pairs: Called before each step with the number of steps since the loss no longer falls
                (negative before) and the detached Gaussians of the last one; returns the pairs of Eq. 4.
                Refinement of the rigid groups happens inside it (Algorithm 2).
            most_steps: Steps at most, if fewer than `config.pace` says.

        Returns:
            The pose after the last step, unit quaternions.
        """
        config = self.config
        turns = torch.zeros_like(start.quats_wxyz).requires_grad_()
        shifts = torch.zeros_like(start.translations).requires_grad_()
        places = self._anchors.positions + start.translations
        nodes = [level.begin(places, target.camera) for level in self._levels]
        posed = self.pose(start)

        def loss_at(pace: Pace) -> torch.Tensor:
            nonlocal posed
            pairs = rigid_pairs(pace.settled_steps, posed)
            poses = self._step_from(start, turns, shifts, nodes)
            live = self.pose(poses)
            posed = live.posed(live.means.detach(), live.quats_wxyz.detach())
            return self._total_loss(target, poses, live, previous, pairs)

        unknowns = [
            {"params": [turns], "lr": config.turn_rate},
            {"params": [shifts], "lr": config.shift_rate},
            *(group for level in nodes for group in level.unknowns),
        ]
        pace = config.pace
        if most_steps is not None:
            pace = dataclasses.replace(pace, most_steps=min(most_steps, pace.most_steps))
        descend(unknowns, pace, loss_at)
        with torch.no_grad():
            return self._step_from(start, turns, shifts, nodes)

    def _step_from(
        self,
        start: AnchorPoses,
        turns: torch.Tensor,
        shifts: torch.Tensor,
        nodes: Sequence[NodeMotion],
    ) -> AnchorPoses:
        quats_wxyz = quaternions.normalize(start.quats_wxyz + self._smoother @ turns)
        rest = self._anchors.positions
        places = rest + start.translations + (self._smoother @ shifts) * self._diagonal
        for level in nodes:
            places, quats_wxyz = level(places, quats_wxyz)
        return AnchorPoses(quats_wxyz=quats_wxyz, translations=places - rest)

    def _total_loss(
        self,
        target: FrameTarget,
        poses: AnchorPoses,
        posed: Gaussians,
        previous: AnchorPoses,
        pairs: RigidPairs | None,
    ) -> torch.Tensor:
        weights = self.config.weights
        total = self.image_loss(posed, target)
        if weights.arap > 0:
            total = total + weights.arap * losses.arap_loss(
                self._anchors, poses, diagonal=self._diagonal, norm=self.config.arap_norm
            )
        if weights.rotation > 0:
            total = total + weights.rotation * losses.rotation_smoothness_loss(
                self._anchors, poses, norm=self.config.turn_norm
            )
        if weights.temporal > 0:
            total = total + weights.temporal * losses.temporal_loss(
                poses, previous, diagonal=self._diagonal, radius=self._anchors.spacing
            )
        if weights.rest > 0:
            total = total + weights.rest * losses.rest_loss(
                poses, diagonal=self._diagonal, norm=self.config.rest_norm
            )
        if weights.deform > 0:
            total = total + weights.deform * self.match_loss(posed, target)
        if weights.depth > 0 and target.depths is not None:
            total = total + weights.depth * self._depth(target.camera, target.depths, posed)
        if weights.group > 0 and pairs is not None:
            total = total + weights.group * self._group(posed, pairs)
        return total

    def _depth(self, camera: Camera, given: GaussianDepths, posed: Gaussians) -> torch.Tensor:
        points = posed.means[torch.as_tensor(given.gaussian_ids, device=posed.means.device)]
        forward = torch.as_tensor(camera.cam_from_world[2]).to(points)
        return losses.depth_loss(
            points @ forward[:3] + forward[3],
            torch.as_tensor(given.depths).to(points),
            torch.as_tensor(given.confidences).to(points),
            diagonal=self._diagonal,
        )

    def _group(self, posed: Gaussians, pairs: RigidPairs) -> torch.Tensor:
        rest = self.gaussians
        return losses.group_loss(
            rest.means[pairs.first] - rest.means[pairs.second],
            rest.quats_wxyz[pairs.first],
            posed.means[pairs.first] - posed.means[pairs.second],
            posed.quats_wxyz[pairs.first],
            diagonal=self._diagonal,
        )


def project(points: torch.Tensor, camera: Camera) -> torch.Tensor:
    """Project world points [scene unit], shape (M, 3), to pixels (centres at +0.5), shape (M, 2)."""
    cam_from_world = torch.as_tensor(
        camera.cam_from_world, dtype=points.dtype, device=points.device
    )
    intrinsics = torch.as_tensor(camera.intrinsics, dtype=points.dtype, device=points.device)
    in_camera = points @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    homogeneous = in_camera @ intrinsics.T
    return homogeneous[:, :2] / in_camera[:, 2:].clamp_min(1e-6)


def _laplacian_smoother(anchors: Anchors, strength: float) -> torch.Tensor:
    """Return (I + strength L)^-1 with L the graph Laplacian scaled to mean degree 1. Shape (A, A)."""
    count = len(anchors)
    adjacency = np.zeros((count, count))
    first, second = anchors.edges.cpu().numpy().T
    adjacency[first, second] = anchors.edge_weights.cpu().numpy()
    adjacency = (adjacency + adjacency.T) / 2
    adjacency /= max(adjacency.sum(axis=1).mean(), 1e-12) if count else 1.0
    laplacian = np.diag(adjacency.sum(axis=1)) - adjacency
    smoother = np.linalg.inv(np.eye(count) + strength * laplacian)
    return torch.as_tensor(smoother, dtype=torch.float32, device=anchors.positions.device)
