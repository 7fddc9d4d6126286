"""Pose from points: known poses, many outliers, and honest failure."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from animator.pnp import solve_pnp
from animator.types import Camera


def _camera(seed: int) -> Camera:
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    pose[:3, 3] = 0.2, -0.1, 4 + rng.uniform(0, 2)
    lens = np.array([[500.0, 0, 203.5], [0, 510.0, 197.0], [0, 0, 1]])
    return Camera(cam_from_world=pose, intrinsics=lens, width_px=400, height_px=400)


def _elsewhere(camera: Camera) -> Camera:
    return camera.with_pose(np.eye(4))


@settings(derandomize=True, max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_pose_is_found_among_forty_percent_outliers(seed):
    rng = np.random.default_rng(seed)
    camera = _camera(seed)
    points = rng.uniform(-1, 1, (200, 3))
    target, _ = camera.project(points)
    target += rng.normal(0, 0.3, target.shape)
    wrong = rng.permutation(200)[:80]
    target[wrong] = rng.uniform(0, 400, (80, 2))
    far_off = np.linalg.norm(target - camera.project(points)[0], axis=1) > 6
    result = solve_pnp(points, target, _elsewhere(camera), threshold_px=3.0)

    assert result.succeeded
    assert not result.inliers[far_off].any()
    assert result.inliers.sum() >= 118
    turn = result.cam_from_world[:3, :3] @ camera.cam_from_world[:3, :3].T
    assert np.degrees(Rotation.from_matrix(turn).magnitude()) < 0.3
    found = camera.with_pose(result.cam_from_world)
    assert np.linalg.norm(found.position - camera.position) < 0.01 * 5


def test_exact_correspondences_give_the_exact_pose():
    camera = _camera(3)
    points = np.random.default_rng(3).uniform(-1, 1, (6, 3))
    target, _ = camera.project(points)
    result = solve_pnp(points, target, _elsewhere(camera), threshold_px=1.0)
    np.testing.assert_allclose(result.cam_from_world, camera.cam_from_world, atol=1e-5)
    assert result.errors_px.max() < 1e-3


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [20, 200])
def test_garbage_has_no_inliers(seed, count):
    rng = np.random.default_rng(seed)
    points, target = rng.uniform(-1, 1, (count, 3)), rng.uniform(0, 400, (count, 2))
    camera = _camera(seed)
    result = solve_pnp(points, target, camera, threshold_px=3.0)
    assert not result.succeeded
    assert result.inliers.shape == (count,) and not result.inliers.any()
    np.testing.assert_array_equal(result.cam_from_world, camera.cam_from_world)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.eye(3),
        np.random.default_rng(0).uniform(-1, 1, (5, 3)),
        np.full((20, 3), 0.25),
        np.full((20, 3), np.nan),
    ],
    ids=["none", "three", "five", "coincident", "not finite"],
)
def test_too_little_to_go_on_is_a_failure(points):
    target = np.random.default_rng(1).uniform(0, 400, (len(points), 2))
    result = solve_pnp(points, target, _camera(0), threshold_px=3.0)
    assert not result.inliers.any() and len(result.inliers) == len(points)


def test_points_that_are_not_finite_are_ignored():
    camera = _camera(7)
    points = np.random.default_rng(7).uniform(-1, 1, (40, 3))
    target, _ = camera.project(points)
    points[3], target[5] = np.nan, np.inf
    result = solve_pnp(points, target, _elsewhere(camera), threshold_px=1.0)
    assert set(np.flatnonzero(~result.inliers)) == {3, 5}


def test_the_answer_does_not_depend_on_opencvs_global_seed():
    rng = np.random.default_rng(8)
    camera = _camera(8)
    points = rng.uniform(-1, 1, (100, 3))
    target = camera.project(points)[0] + rng.normal(0, 1.0, (100, 2))
    target[:40] = rng.uniform(0, 400, (40, 2))
    poses = []
    for seed in (1, 2):
        cv2.setRNGSeed(seed)
        poses.append(solve_pnp(points, target, camera, threshold_px=3.0).cam_from_world)
    np.testing.assert_array_equal(poses[0], poses[1])
