import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.gauss_newton import MatchProblem, MatchSolverConfig, _Solver, solve_matches
from animator.deform.robust_norm import RobustNorm
from animator.deform.skinning import Skinner
from animator.types import AnchorPoses, GaussianMatches
from tests.helpers.objects import box_points, front_camera, gaussians_at


@pytest.fixture(scope="module")
def bar():
    points = box_points((0, 0, 0), (1.6, 0.5, 0.5), 1200, 0)
    gaussians = gaussians_at(points)
    return points, gaussians, build_anchors(gaussians, target_count=30)


def problem_for(bar, moved: np.ndarray, *, outliers: int = 0) -> MatchProblem:
    points, gaussians, anchors = bar
    camera = front_camera()
    pixels, _ = camera.project(moved)
    pixels[:outliers] += 60.0
    matches = GaussianMatches(
        gaussian_ids=np.arange(len(points)), target_px=pixels, confidences=np.ones(len(points))
    )
    return MatchProblem(
        anchors=anchors,
        rest_means=points,
        camera=camera,
        terms=((matches, 1.0),),
        diagonal=gaussians.diagonal,
        object_px=150.0,
    )


def solve(bar, problem: MatchProblem, **changes) -> np.ndarray:
    _, gaussians, anchors = bar
    rest = AnchorPoses.identity(anchors)
    config = MatchSolverConfig(**{"iterations": 12, "rest": 0.0, **changes})
    poses = solve_matches(problem, rest, rest, config)
    return Skinner(anchors, gaussians.means, gaussians.quats_wxyz)(poses)[0].numpy()


@pytest.mark.parametrize("outliers", [0, 150])
def test_recovers_a_rigid_motion_in_depth_too(bar, outliers):
    points = bar[0]
    turn = Rotation.from_euler("xyz", [10, 25, -15], degrees=True).as_matrix()
    moved = points @ turn.T + [0.1, -0.05, 0.15]
    solved = solve(bar, problem_for(bar, moved, outliers=outliers), tether=1e-6)
    error = np.linalg.norm(solved - moved, axis=1) / bar[1].diagonal
    assert np.median(error) < 0.004
    assert error.max() < 0.02


def test_bends_where_the_matches_bend(bar):
    points = bar[0]
    turn = Rotation.from_euler("z", 35, degrees=True).as_matrix()
    moved = np.where(points[:, :1] > 0, points @ turn.T, points)
    solved = solve(bar, problem_for(bar, moved), tether=1e-6, arap=1.0)
    far = np.abs(points[:, 0]) > 0.4
    # Across the view, and of the ends only: thirty anchors round the hinge off, and along the
    # viewing ray it is free to drift a little. The right end moved by a quarter of the diagonal.
    error = np.linalg.norm((solved - moved)[far, :2], axis=1) / bar[1].diagonal
    assert np.median(error) < 0.02


def test_without_matches_nothing_moves(bar):
    points, gaussians, _ = bar
    problem = problem_for(bar, points)
    empty = GaussianMatches(
        gaussian_ids=np.zeros(0, int), target_px=np.zeros((0, 2)), confidences=np.zeros(0)
    )
    still = MatchProblem(**{**problem.__dict__, "terms": ((empty, 1.0),)})
    np.testing.assert_allclose(solve(bar, still), gaussians.means.numpy(), atol=1e-5)


def test_jacobians_match_finite_differences(bar):
    points = bar[0]
    _, _, anchors = bar
    problem = problem_for(bar, points + 0.01)
    poses = AnchorPoses.identity(anchors)
    # Plain squares: the weights of a robust norm are held fixed within a step.
    plain = MatchSolverConfig(huber=1e9, arap_norm=RobustNorm(), turn_norm=RobustNorm())
    solver = _Solver(problem, poses, plain)
    rng = np.random.default_rng(1)
    rotations = Rotation.from_rotvec(rng.normal(0, 0.2, (len(anchors), 3))).as_matrix()
    translations = rng.normal(0, 0.05, (len(anchors), 3))
    direction = rng.normal(0, 1, (len(anchors), 6))
    blocks = {
        "matches": lambda r, t: solver._matches(*problem.terms[0], r, t),
        "arap": solver._arap,
        "smoothness": lambda r, t: solver._smoothness(r),
    }
    step = 1e-5
    for name, block in blocks.items():
        here = block(rotations, translations)
        turned = Rotation.from_rotvec(step * direction[:, :3]).as_matrix() @ rotations
        there = block(turned, translations + step * direction[:, 3:])
        expected = np.einsum("erki,eki->er", here.jacobian, direction[here.anchor_ids])
        # The rotation-vector residual is linearized at small angles between neighbors.
        tolerance = 0.25 if name == "smoothness" else 1e-3
        change = (there.values - here.values) / step
        error = np.linalg.norm(change - expected) / np.linalg.norm(expected)
        assert error < tolerance, name


def test_result_is_unit_and_finite(bar):
    rest = AnchorPoses.identity(bar[2])
    poses = solve_matches(problem_for(bar, bar[0] * 1.3), rest, rest, MatchSolverConfig())
    norms = poses.quats_wxyz.norm(dim=1)
    torch.testing.assert_close(norms, torch.ones_like(norms))
    assert torch.isfinite(poses.translations).all()
