"""Fast solver of the match and ARAP energy: Gauss-Newton over all anchors at once (embedded deformation).

Unknowns are a rotation vector (applied on the left) and a translation for each anchor. Excellent where the
texture gives good matches and wrong where it does not, so its result is only a candidate start for the image
stage (see `sequence/driver.py`, which keeps it only if its render explains the frame better).
"""

import dataclasses

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from animator.deform.normal_equations import UNKNOWNS, NormalEquations, Residuals
from animator.deform.robust_norm import RobustNorm
from animator.types import AnchorPoses, Anchors, Camera, GaussianMatches


@dataclasses.dataclass(frozen=True, kw_only=True)
class MatchSolverConfig:
    """Weights of the match solver; lengths in diagonals, pixels in object sizes."""

    arap: float = 10.0
    """Weight of Eq. 5."""
    rotation: float = 0.02
    """Weight of the smoothness of rotations."""
    tether: float = 1e-3
    """Weight of the previous pose: holds what no match sees. A strong one drags what moves, along the viewing
    ray most of all."""
    rest: float = 0.03
    """Weight of the rest pose: keeps what has hardly moved from drifting along the viewing ray."""
    arap_norm: RobustNorm = RobustNorm(reach=0.004, floor=0.02)
    """What the residuals of Eq. 5 cost [diagonals]."""
    turn_norm: RobustNorm = RobustNorm(reach=0.1)
    """What |R_i - R_j| of neighboring anchors costs; 0.1 is 4 degrees."""
    rest_norm: RobustNorm = RobustNorm(reach=0.03)
    """What motion from rest costs [diagonals]."""
    huber: float = 0.01
    """Reprojection error above which a match counts linearly [share of the object's size]."""
    damping: float = 1e-4
    """Levenberg-Marquardt damping, relative to the diagonal of the normal matrix."""
    iterations: int = 4
    """Most Gauss-Newton steps of one solve."""
    max_turn_rad: float = 0.6
    """Largest rotation of one step [rad]."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class MatchProblem:
    """One solve: which Gaussians should project where."""

    anchors: Anchors
    rest_means: np.ndarray
    """Rest centres of all Gaussians [scene unit], shape (N, 3)."""
    camera: Camera
    terms: tuple[tuple[GaussianMatches, float], ...]
    """Sets of matches with the weight of each set."""
    diagonal: float
    """The object's diagonal [scene unit]."""
    object_px: float
    """Size of the object in the image [px]."""


def solve_matches(
    problem: MatchProblem, start: AnchorPoses, previous: AnchorPoses, config: MatchSolverConfig
) -> AnchorPoses:
    """Minimize matches + ARAP + rotation smoothness + tether from `start`.

    Args:
        problem: Matches and camera.
        start: Where the iteration begins.
        previous: The pose the tether holds to.
        config: Weights and limits.

    Returns:
        The solved pose.
    """
    solver = _Solver(problem, previous, config)
    rotations, translations = _motions(start)
    for _ in range(config.iterations):
        step = solver.normal_equations(rotations, translations).step(config.damping)
        largest_turn = float(np.abs(step[:, :3]).max(initial=0.0))
        if largest_turn > config.max_turn_rad:
            step *= config.max_turn_rad / largest_turn
        rotations = Rotation.from_rotvec(step[:, :3]).as_matrix() @ rotations
        translations = translations + step[:, 3:]
        if largest_turn < 3e-3 and np.abs(step[:, 3:]).max(initial=0.0) < 2e-4 * problem.diagonal:
            break
    quats_wxyz = Rotation.from_matrix(rotations).as_quat(scalar_first=True)
    return AnchorPoses(
        quats_wxyz=torch.as_tensor(quats_wxyz, dtype=torch.float32),
        translations=torch.as_tensor(translations, dtype=torch.float32),
    )


def information_at(
    problem: MatchProblem, poses: AnchorPoses, config: MatchSolverConfig
) -> np.ndarray:
    """Return the normal matrix of the energy at a pose, tethered to that pose, shape (6 A, 6 A).

    The sum of J^T J over all terms. The unknowns of an anchor are a turn [rad], then a shift [scene unit].
    """
    return _Solver(problem, poses, config).normal_equations(*_motions(poses)).matrix()


def _motions(poses: AnchorPoses) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation matrices, shape (A, 3, 3), and translations, shape (A, 3)."""
    rotations = Rotation.from_quat(_numpy(poses.quats_wxyz), scalar_first=True).as_matrix()
    return rotations, _numpy(poses.translations)


def _numpy(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().cpu().numpy().astype(np.float64)


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return cross products over the last axis; several times faster than numpy's."""
    a, b, c = np.moveaxis(first, -1, 0)
    x, y, z = np.moveaxis(second, -1, 0)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def _cross_matrices(vectors: np.ndarray) -> np.ndarray:
    """Return [v]x for each vector, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


class _Solver:
    """Builds and solves the normal equations of one Gauss-Newton step."""

    def __init__(
        self, problem: MatchProblem, previous: AnchorPoses, config: MatchSolverConfig
    ) -> None:
        self.problem = problem
        self.config = config
        anchors = problem.anchors
        self.anchor_positions = _numpy(anchors.positions)
        self.edges = anchors.edges.cpu().numpy()
        self.edge_weights = _numpy(anchors.edge_weights)
        self.skin_ids = anchors.skin_ids.cpu().numpy().astype(np.int64)
        self.skin_weights = _numpy(anchors.skin_weights)
        self.previous_rotations, self.previous_translations = _motions(previous)
        matched = [self.skin_ids[matches.gaussian_ids] for matches, _ in problem.terms]
        self._equations = NormalEquations(len(anchors), [self.edges, *matched])

    def normal_equations(self, rotations: np.ndarray, translations: np.ndarray) -> NormalEquations:
        """Return the sums of J^T J and of J^T r over all terms; valid until the next call."""
        equations = self._equations
        equations.clear()
        for matches, weight in self.problem.terms:
            equations.add(self._matches(matches, weight, rotations, translations))
        equations.add(self._arap(rotations, translations))
        equations.add(self._smoothness(rotations))
        equations.add_diagonal(*self._tether(rotations, translations))
        return equations

    def _matches(
        self,
        matches: GaussianMatches,
        weight: float,
        rotations: np.ndarray,
        translations: np.ndarray,
    ) -> Residuals:
        """Huber-weighted reprojection residuals (Eq. 3) of the skinned Gaussians (Eq. 2)."""
        problem = self.problem
        ids = self.skin_ids[matches.gaussian_ids]
        skin = self.skin_weights[matches.gaussian_ids]
        offsets = problem.rest_means[matches.gaussian_ids][:, None] - self.anchor_positions[ids]
        arms = np.einsum("mkij,mkj->mki", rotations[ids], offsets)
        points = np.einsum(
            "mk,mki->mi", skin, arms + self.anchor_positions[ids] + translations[ids]
        )

        world_to_cam = problem.camera.cam_from_world
        x, y, z = np.moveaxis(points @ world_to_cam[:3, :3].T + world_to_cam[:3, 3], -1, 0)
        z = np.where(np.abs(z) < 1e-9, 1e-9, z)
        focal_x, focal_y = problem.camera.intrinsics[0, 0], problem.camera.intrinsics[1, 1]
        center = problem.camera.intrinsics[:2, 2]
        projected = np.stack([focal_x * x / z, focal_y * y / z], axis=1) + center
        zero = np.zeros_like(z)
        by_camera = np.stack(
            [
                np.stack([focal_x / z, zero, -focal_x * x / z**2], axis=1),
                np.stack([zero, focal_y / z, -focal_y * y / z**2], axis=1),
            ],
            axis=1,
        )
        by_point = by_camera @ world_to_cam[:3, :3] / problem.object_px
        residuals = (projected - matches.target_px) / problem.object_px

        distances = np.linalg.norm(residuals, axis=1)
        robust = np.minimum(1.0, self.config.huber / np.maximum(distances, 1e-12))
        share = weight * matches.confidences / max(matches.confidences.sum(), 1e-9)
        roots = np.sqrt(robust * share)[:, None]
        by_shift = (by_point * roots[:, None])[:, :, None] * skin[:, None, :, None]  # (M, 2, K, 3)
        # A turn w moves the end of an arm v by w x v, and a . (w x v) = w . (v x a).
        by_turn = _cross(arms[:, None], by_shift)
        return Residuals(
            values=residuals * roots,
            jacobian=np.concatenate([by_turn, by_shift], axis=-1),
            anchor_ids=ids,
        )

    def _arap(self, rotations: np.ndarray, translations: np.ndarray) -> Residuals:
        """Residuals R_i (a_j - a_i) - (a'_j - a'_i) of the anchor graph (Eq. 5)."""
        first, second = self.edges.T
        rest = self.anchor_positions[second] - self.anchor_positions[first]
        arms = np.einsum("eij,ej->ei", rotations[first], rest)
        residuals = arms - rest - translations[second] + translations[first]
        squared = np.einsum("ei,ei->e", residuals, residuals) / self.problem.diagonal**2
        weights = self.edge_weights * self.config.arap_norm.weight(squared)
        roots = np.sqrt(self.config.arap * weights / max(len(first), 1)) / self.problem.diagonal
        jacobian = np.zeros((len(first), 3, 2, UNKNOWNS))
        jacobian[:, :, 0, :3] = -_cross_matrices(arms)
        jacobian[:, :, 0, 3:] = np.eye(3)
        jacobian[:, :, 1, 3:] = -np.eye(3)
        jacobian *= roots[:, None, None, None]
        return Residuals(
            values=residuals * roots[:, None], jacobian=jacobian, anchor_ids=self.edges
        )

    def _smoothness(self, rotations: np.ndarray) -> Residuals:
        """Rotation vectors between neighboring anchors."""
        first, second = self.edges.T
        between = rotations[first] @ rotations[second].transpose(0, 2, 1)
        residuals = Rotation.from_matrix(between).as_rotvec() if len(first) else np.zeros((0, 3))
        squared = 2.0 * np.einsum("ei,ei->e", residuals, residuals)  # |R_i - R_j|^2 of a small turn
        weights = self.config.turn_norm.weight(squared)
        roots = np.sqrt(self.config.rotation * weights / max(len(first), 1))
        jacobian = np.zeros((len(first), 3, 2, UNKNOWNS))
        jacobian[:, :, 0, :3] = np.eye(3) * roots[:, None, None]
        jacobian[:, :, 1, :3] = -np.eye(3) * roots[:, None, None]
        return Residuals(
            values=residuals * roots[:, None], jacobian=jacobian, anchor_ids=self.edges
        )

    def _tether(
        self, rotations: np.ndarray, translations: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Hold every anchor near the previous pose and the rest pose: diagonal weights and pulls, (A, 6)."""
        count = len(translations)
        moved = translations - self.previous_translations
        between = rotations @ self.previous_rotations.transpose(0, 2, 1)
        turned = Rotation.from_matrix(between).as_rotvec()
        tether = self.config.tether / count
        turn_weights = np.full((count, 1), tether * self.config.rotation)
        shift_weights = np.full((count, 1), tether / self.problem.diagonal**2)
        # What clearly moved is let go; what stands still is held where it was captured.
        squared = (translations**2).sum(axis=1, keepdims=True) / self.problem.diagonal**2
        rest_weights = self.config.rest_norm.weight(squared)
        rest_weights *= self.config.rest / count / self.problem.diagonal**2
        weights = np.repeat(np.hstack([turn_weights, shift_weights + rest_weights]), 3, axis=1)
        pulls = np.hstack(
            [turn_weights * turned, shift_weights * moved + rest_weights * translations]
        )
        return weights, pulls
