"""Smooth motion between two solved frames (paper Sec. 3.4, L_inter).

Each in-between aims at the blend of the two keys (rotations on the sphere, translations on a line). A pure blend
shears and shrinks whatever turns far; so the anchors approach the blend while ARAP and the rigid groups hold.
Rigid is not the shape at rest, though: what is bent in both keys would be straightened between them, and shake.
The arms from anchor to anchor, each in the turned frame of its first anchor, go from one key's to the other's
(Alexa, Cohen-Or, Levin, "As-rigid-as-possible shape interpolation", 2000), so both keys are met exactly.
Where the paper plays the iterates of one gradient descent as frames, every in-between here is the minimum of
L_inter at its own moment, with squared norms, found by alternating its two closed forms: rotations by a polar
decomposition, translations by one linear system. The number of frames is what was asked for, the speed even.
"""

import dataclasses
from collections.abc import Sequence

import torch

from animator import quaternions
from animator.types import AnchorPoses, Anchors, RigidGroups


@dataclasses.dataclass(frozen=True, kw_only=True)
class InterpolationConfig:
    """Weights of L_inter."""

    rounds: int = 20
    """Alternations of rotations and translations."""
    turn_goal: float = 1.0
    """Weight of the mean squared distance |R - R^|^2 from the blend."""
    shift_goal: float = 1.0
    """Weight of the mean squared distance |T - T^|^2 from the blend [diagonals^2]."""
    rigidity: float = 2000.0
    """Weight lambda_inter of ARAP and groups."""


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
    start: AnchorPoses,
    end: AnchorPoses,
    count: int,
    config: InterpolationConfig,
) -> Sequence[AnchorPoses]:
    """Make `count` evenly spaced poses strictly between two keys.

    Args:
        anchors: The rig.
        anchor_groups: Rigid group of each anchor (its labels have length A).
        start: The key before.
        end: The key after.
        count: Number of in-betweens.
        config: Weights.

    Returns:
        The in-between poses in order; the keys themselves are not repeated.
    """
    rigidity = _Rigidity(anchors, anchor_groups)
    first_arms, last_arms = rigidity.arms(start), rigidity.arms(end)
    shares = [(k + 1) / (count + 1) for k in range(count)]
    return [
        rigidity.approach(
            blend(start, end, share), torch.lerp(first_arms, last_arms, share), config
        )
        for share in shares
    ]


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
        count = len(self.positions)
        laplacian = torch.zeros(count, count, dtype=torch.float64)
        for row, column, sign in (
            (self.first, self.first, 1.0),
            (self.second, self.second, 1.0),
            (self.first, self.second, -1.0),
            (self.second, self.first, -1.0),
        ):
            laplacian.index_put_((row, column), sign * weights, accumulate=True)
        self.laplacian = laplacian

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
        pull = config.shift_goal / count
        system = pull * torch.eye(count, dtype=torch.float64) + rigidity * self.laplacian
        factor = torch.linalg.cholesky(system)
        rotations = goal_rotations
        points = goal_points
        for _ in range(config.rounds):
            turned = (rotations[self.first] @ arms[:, :, None])[..., 0] * self.weights
            sums = torch.zeros_like(points).index_add_(0, self.first, turned)
            sums = sums.index_add_(0, self.second, -turned)
            points = torch.cholesky_solve(pull * goal_points + rigidity * sums, factor)
            posed = points[self.first] - points[self.second]
            outer = (self.weights * posed)[:, :, None] * arms[:, None]
            moments = (config.turn_goal / count) * goal_rotations
            moments = moments.index_add(
                0, self.first, outer, alpha=rigidity / self.squared_diagonal
            )
            rotations = _nearest_rotations(moments)
        return AnchorPoses(
            quats_wxyz=quaternions.from_matrices(rotations).to(goal.quats_wxyz),
            translations=(points - self.positions).to(goal.translations),
        )


def _nearest_rotations(matrices: torch.Tensor) -> torch.Tensor:
    """Return the proper rotations that maximize tr(R^T M) (orthogonal Procrustes), shape (A, 3, 3)."""
    left, _, right = torch.linalg.svd(matrices)
    handedness = torch.linalg.det(left @ right).sign()
    flips = torch.ones_like(matrices[..., 0])
    flips[:, 2] = handedness
    return (left * flips[:, None]) @ right
