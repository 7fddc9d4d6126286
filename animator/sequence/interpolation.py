"""Smooth motion between solved frames (paper Sec. 3.4, L_inter).

Each in-between aims at a curve through all keys: modified Akima (scipy's `makima`), which bends round the keys and
does not swing past a stop. A pure curve shears and shrinks whatever turns far between two keys; so the anchors
approach it while ARAP and the rigid groups hold, edge by edge as far as the curve would strain it.
Rigid is not the shape at rest, though: what is bent in both keys would be straightened between them, and shake.
The arms from anchor to anchor, each in the turned frame of its first anchor, go from one key's to the other's
(Alexa, Cohen-Or, Levin, "As-rigid-as-possible shape interpolation", 2000), so both keys are met exactly.
Where the paper plays the iterates of one gradient descent as frames, every in-between here is the minimum of
L_inter at its own moment, with squared norms, found by alternating its two closed forms: rotations by a polar
decomposition, translations by one linear system. The number of frames is what was asked for, the speed even.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch
from scipy.interpolate import Akima1DInterpolator

from animator import quaternions
from animator.types import AnchorPoses, Anchors, RigidGroups


@dataclasses.dataclass(frozen=True, kw_only=True)
class InterpolationConfig:
    """Weights of L_inter."""

    rounds: int = 20
    """Alternations of rotations and translations."""
    turn_goal: float = 1.0
    """Weight of the mean squared distance |R - R^|^2 from the curve."""
    shift_goal: float = 1.0
    """Weight of the mean squared distance |T - T^|^2 from the curve [diagonals^2]."""
    rigidity: float = 2000.0
    """Weight lambda_inter of ARAP and groups."""
    free_strain: float = 0.1
    """Strain of an edge on the curve at which half of that weight holds it; far less is let be."""


def blend(start: AnchorPoses, end: AnchorPoses, share: float) -> AnchorPoses:
    """Blend two poses: slerp along the shorter arc and lerp. `share` 0 is start, 1 is end."""
    cosines = (start.quats_wxyz * end.quats_wxyz).sum(dim=1, keepdim=True)
    end_quats = torch.where(cosines < 0, -end.quats_wxyz, end.quats_wxyz)
    angles = torch.arccos(cosines.abs().clamp(max=1.0))
    sines = torch.sin(angles)
    equal = sines < 1e-6
    safe = torch.where(equal, torch.ones_like(sines), sines)
    first = torch.where(
        equal, torch.full_like(sines, 1 - share), torch.sin((1 - share) * angles) / safe
    )
    second = torch.where(equal, torch.full_like(sines, share), torch.sin(share * angles) / safe)
    return AnchorPoses(
        quats_wxyz=quaternions.normalize(first * start.quats_wxyz + second * end_quats),
        translations=torch.lerp(start.translations, end.translations, share),
    )


def interpolate(
    anchors: Anchors,
    anchor_groups: RigidGroups,
    keys: Sequence[AnchorPoses],
    count: int,
    config: InterpolationConfig,
) -> list[list[AnchorPoses]]:
    """Make `count` evenly spaced poses strictly between every two neighboring keys.

    Args:
        anchors: The rig.
        anchor_groups: Rigid group of each anchor (its labels have length A).
        keys: The poses to go through, evenly spaced in time, T of them.
        count: Number of in-betweens in each gap.
        config: Weights.

    Returns:
        The in-between poses of each of the T - 1 gaps in order; the keys themselves are not repeated.
    """
    if count == 0 or len(keys) < 2:
        return [[] for _ in keys[1:]]
    rigidity = _Rigidity(anchors, anchor_groups)
    shares = [(k + 1) / (count + 1) for k in range(count)]
    key_arms = [rigidity.arms(key) for key in keys]
    return [
        [
            rigidity.approach(goal, torch.lerp(key_arms[gap], key_arms[gap + 1], share), config)
            for goal, share in zip(goals, shares, strict=True)
        ]
        for gap, goals in enumerate(_curve(keys, shares))
    ]


def _curve(keys: Sequence[AnchorPoses], shares: Sequence[float]) -> list[list[AnchorPoses]]:
    """Lay a smooth curve through the keys and read it at the shares of every gap.

    By how much the curve leaves the line is added to the blend, so that two keys alone give the blend.
    """
    tracks = torch.stack([torch.cat([key.quats_wxyz, key.translations], dim=1) for key in keys])
    cosines = (tracks[1:, :, :4] * tracks[:-1, :, :4]).sum(dim=2, keepdim=True)
    tracks[1:, :, :4] *= torch.where(cosines < 0, -1.0, 1.0).cumprod(dim=0)
    curves = Akima1DInterpolator(
        np.arange(len(keys)), tracks.double().cpu().numpy(), method="makima"
    )

    def goal(gap: int, share: float) -> AnchorPoses:
        start, end = (
            AnchorPoses(quats_wxyz=track[:, :4], translations=track[:, 4:])
            for track in tracks[gap : gap + 2]
        )
        straight = blend(start, end, share)
        off_line = torch.as_tensor(curves(gap + share)).to(tracks) - torch.lerp(
            tracks[gap], tracks[gap + 1], share
        )
        return AnchorPoses(
            quats_wxyz=quaternions.normalize(straight.quats_wxyz + off_line[:, :4]),
            translations=straight.translations + off_line[:, 4:],
        )

    return [[goal(gap, share) for share in shares] for gap in range(len(keys) - 1)]


class _Rigidity:
    """The quadratic form of ARAP (Eq. 5) plus groups (Eq. 4, between the anchors of one group)."""

    def __init__(self, anchors: Anchors, groups: RigidGroups) -> None:
        labels = torch.as_tensor(groups.labels)
        together = (labels[:, None] == labels[None]) & (labels[:, None] >= 0)
        together.fill_diagonal_(False)
        grouped = together.nonzero()
        edges = torch.cat([anchors.edges.cpu(), grouped])
        weights = torch.cat(
            [
                anchors.edge_weights.cpu().double() / max(len(anchors.edges), 1),
                torch.full((len(grouped),), 1.0 / max(len(grouped), 1), dtype=torch.float64),
            ]
        )
        self.positions = anchors.positions.cpu().double()
        extent = self.positions.amax(dim=0) - self.positions.amin(dim=0)
        self.squared_diagonal = max(float(extent.square().sum()), 1e-12)
        self.first, self.second = edges.unbind(dim=1)
        self.weights = weights[:, None]

    def arms(self, poses: AnchorPoses) -> torch.Tensor:
        """Return R_i^T (x_i - x_j) of every edge, shape (E, 3): at rest, and where it is rigid, a_i - a_j."""
        points = self.positions + poses.translations.cpu().double()
        rotations = quaternions.to_matrices(poses.quats_wxyz.cpu().double())
        between = points[self.first] - points[self.second]
        return (rotations[self.first].transpose(1, 2) @ between[:, :, None])[..., 0]

    def approach(
        self, goal: AnchorPoses, arms: torch.Tensor, config: InterpolationConfig
    ) -> AnchorPoses:
        """Minimize turn_goal |R - R^|^2 + shift_goal |T - T^|^2 / D^2 + rigidity * E_rigid / D^2.

        Args:
            goal: R^ and T^.
            arms: What E_rigid holds the arms of the edges to, shape (E, 3).
            config: Weights.
        """
        rigidity = config.rigidity
        count = len(self.positions)
        goal_rotations = quaternions.to_matrices(goal.quats_wxyz.cpu().double())
        goal_points = self.positions + goal.translations.cpu().double()
        weights = self.weights * self._strain_shares(goal_points, arms, config.free_strain)
        pull = config.shift_goal / count
        system = pull * torch.eye(count, dtype=torch.float64) + rigidity * self._laplacian(weights)
        factor = torch.linalg.cholesky(system)
        rotations = goal_rotations
        points = goal_points
        for _ in range(config.rounds):
            turned = (rotations[self.first] @ arms[:, :, None])[..., 0] * weights
            sums = torch.zeros_like(points).index_add_(0, self.first, turned)
            sums = sums.index_add_(0, self.second, -turned)
            points = torch.cholesky_solve(pull * goal_points + rigidity * sums, factor)
            posed = points[self.first] - points[self.second]
            outer = (weights * posed)[:, :, None] * arms[:, None]
            moments = (config.turn_goal / count) * goal_rotations
            moments = moments.index_add(
                0, self.first, outer, alpha=rigidity / self.squared_diagonal
            )
            rotations = _nearest_rotations(moments)
        return AnchorPoses(
            quats_wxyz=quaternions.from_matrices(rotations).to(goal.quats_wxyz),
            translations=(points - self.positions).to(goal.translations),
        )

    def _strain_shares(
        self, goal_points: torch.Tensor, arms: torch.Tensor, free_strain: float
    ) -> torch.Tensor:
        """Say how much each edge needs to be held, 0..1: by how much the goal stretches it, shape (E, 1)."""
        lengths = (goal_points[self.first] - goal_points[self.second]).norm(dim=1, keepdim=True)
        wanted = arms.norm(dim=1, keepdim=True).clamp_min(1e-12)
        squared = (lengths / wanted - 1.0).square()
        return squared / (squared + free_strain**2)

    def _laplacian(self, weights: torch.Tensor) -> torch.Tensor:
        """Return the graph Laplacian of weighted edges, weights of shape (E, 1), shape (A, A)."""
        count = len(self.positions)
        laplacian = torch.zeros(count, count, dtype=torch.float64)
        for row, column, sign in (
            (self.first, self.first, 1.0),
            (self.second, self.second, 1.0),
            (self.first, self.second, -1.0),
            (self.second, self.first, -1.0),
        ):
            laplacian.index_put_((row, column), sign * weights[:, 0], accumulate=True)
        return laplacian


def _nearest_rotations(matrices: torch.Tensor) -> torch.Tensor:
    """Return the proper rotations that maximize tr(R^T M) (orthogonal Procrustes), shape (A, 3, 3)."""
    left, _, right = torch.linalg.svd(matrices)
    handedness = torch.linalg.det(left @ right).sign()
    flips = torch.ones_like(matrices[..., 0])
    flips[:, 2] = handedness
    return (left * flips[:, None]) @ right
