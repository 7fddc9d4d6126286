"""A camera that was never given, found from renders of the capture's views."""

import dataclasses
import logging

import numpy as np
import pytest
import torch

from animator.errors import InputError
from animator.match.features import FeatureMatcher
from animator.match.flow import FlowMatcher
from animator.match.protocol import MaskedImage
from animator.render.cpu import CpuRenderer
from animator.sequence.camera_pose import (
    CameraSearch,
    CameraTools,
    find_camera,
    refine_camera,
    render_masked,
)
from animator.sequence.capture_views import at_frame, resized, shrunk, spread_cameras
from animator.types import Camera, Gaussians

SIDE_PX = 200


@pytest.fixture(scope="module")
def tools() -> CameraTools:
    return CameraTools(
        renderer=CpuRenderer(), features=FeatureMatcher(keypoint_count=512), matcher=FlowMatcher()
    )


@pytest.fixture(scope="module")
def ball() -> Gaussians:
    """A lumpy ball with patches of random colors."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(6000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    bumps = 1 + 0.15 * np.sin(directions @ rng.normal(0, 4, (3, 5))).mean(axis=1)
    patches = rng.normal(size=(150, 3))
    patches /= np.linalg.norm(patches, axis=1, keepdims=True)
    colors = rng.uniform(-1.6, 1.6, (150, 1, 3))[(directions @ patches.T).argmax(axis=1)]
    count = len(directions)
    return Gaussians(
        means=torch.from_numpy((directions * bumps[:, None]).astype(np.float32)),
        quats_wxyz=torch.tensor([[1.0, 0, 0, 0]]).repeat(count, 1),
        scales=torch.full((count, 3), 0.025),
        opacities=torch.full((count,), 0.95),
        sh_coeffs=torch.from_numpy(colors.astype(np.float32)),
    )


def _camera(azimuth_deg: float, elevation_deg: float = 10.0, name: str = "") -> Camera:
    """Look at the origin from a distance of 4, y down in the image."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    position = 4 * np.array(
        [
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
            np.cos(elevation) * np.cos(azimuth),
        ]
    )
    forward = -position / 4
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = -pose[:3, :3] @ position
    lens = np.array([[300.0, 0, 100.0], [0, 300.0, 100.0], [0, 0, 1]])
    return Camera(
        cam_from_world=pose, intrinsics=lens, width_px=SIDE_PX, height_px=SIDE_PX, name=name
    )


def _errors(found: Camera, true: Camera) -> tuple[float, float]:
    """Return the rotation error [degrees] and the position error [share of the distance]."""
    turn = found.cam_from_world[:3, :3] @ true.cam_from_world[:3, :3].T
    angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    return angle, float(np.linalg.norm(found.position - true.position) / 4)


def test_a_camera_between_the_capture_views_is_found(ball, tools):
    capture = [_camera(azimuth, name=f"view_{azimuth}") for azimuth in range(0, 360, 90)]
    true = _camera(101.0, 18.0)
    frame = render_masked(tools.renderer, ball, true)
    found = find_camera(ball, capture, frame, tools)
    angle_deg, distance_share = _errors(found.camera, true)
    assert angle_deg < 0.3
    assert distance_share < 0.006
    assert found.report.view_name == found.camera.name == "view_90"
    assert found.report.silhouette_iou > 0.97
    assert found.report.error_px < 0.3
    assert len(found.report.match_counts) == len(found.report.inlier_counts) >= 2


def test_refinement_follows_a_camera_that_moved_a_little(ball, tools):
    true = _camera(42.0, 12.0)
    frame = render_masked(tools.renderer, ball, true)
    found = refine_camera(ball, _camera(40.0, 10.0, name="guess"), frame, tools)
    angle_deg, distance_share = _errors(found.camera, true)
    assert angle_deg < 0.3
    assert distance_share < 0.006


def test_refinement_without_support_keeps_the_guess_and_warns(ball, tools, caplog):
    guess = _camera(0.0)
    mask = np.zeros((SIDE_PX, SIDE_PX), bool)
    mask[5:25, 5:25] = True
    unrelated = MaskedImage(rgb=np.full((SIDE_PX, SIDE_PX, 3), 90, np.uint8), mask=mask)
    with caplog.at_level(logging.WARNING):
        found = refine_camera(ball, guess, unrelated, tools)
    np.testing.assert_array_equal(found.camera.cam_from_world, guess.cam_from_world)
    assert found.report.inlier_counts == (0,)
    assert len(caplog.records) == 1


def test_unrelated_frames_and_missing_input_are_refused(ball, tools):
    noise = np.random.default_rng(1).integers(0, 256, (SIDE_PX, SIDE_PX, 3), np.uint8)
    mask = np.zeros((SIDE_PX, SIDE_PX), bool)
    mask[40:160, 40:160] = True
    frame = MaskedImage(rgb=noise, mask=mask)
    search = CameraSearch(candidate_count=1)
    with pytest.raises(InputError, match=r"no capture view matches.*--frame-camera FILE"):
        find_camera(ball, [_camera(0.0)], frame, tools, search=search)
    with pytest.raises(InputError, match="--cameras"):
        find_camera(ball, [], frame, tools)
    empty = dataclasses.replace(frame, mask=np.zeros_like(mask))
    with pytest.raises(InputError, match="mask is empty"):
        find_camera(ball, [_camera(0.0)], empty, tools)


def test_a_lens_scales_with_the_longer_side():
    camera = dataclasses.replace(
        _camera(0.0),
        intrinsics=np.array([[1500.0, 0, 970.0], [0, 1510.0, 530.0], [0, 0, 1]]),
        width_px=1920,
        height_px=1080,
    )
    half = at_frame(camera, 960, 540, None)
    np.testing.assert_allclose(half.intrinsics[:2], camera.intrinsics[:2] / 2)
    # Upright instead of lying: the same focal length, the same offset from the center.
    upright = at_frame(camera, 1080, 1920, None)
    np.testing.assert_allclose(upright.intrinsics, [[1500, 0, 550], [0, 1510, 950], [0, 0, 1]])
    given = at_frame(camera, 640, 480, np.diag([400.0, 400.0, 1.0]))
    np.testing.assert_array_equal(given.intrinsics, np.diag([400.0, 400.0, 1.0]))
    assert (given.width_px, given.height_px) == (640, 480)


def test_resizing_a_camera_scales_where_points_project():
    camera = _camera(30.0)
    points = np.random.default_rng(2).uniform(-1, 1, (20, 3))
    small = resized(camera, (50, 100))
    expected = camera.project(points)[0] * np.array([0.5, 0.25])
    np.testing.assert_allclose(small.project(points)[0], expected, atol=1e-9)


def test_thinned_views_stay_spread_out():
    cameras = [_camera(azimuth, name=str(azimuth)) for azimuth in (0, 1, 2, 3, 90, 180, 181, 270)]
    chosen = {camera.name for camera in spread_cameras(cameras, 4)}
    assert chosen in ({"0", "90", "180", "270"}, {"0", "90", "181", "270"})
    assert spread_cameras(cameras, 8) == cameras


def test_shrinking_keeps_the_shape_of_the_image():
    mask = np.zeros((300, 600), bool)
    mask[100:200, 150:450] = True
    image = MaskedImage(rgb=np.zeros((300, 600, 3), np.uint8), mask=mask)
    small = shrunk(image, 60)
    assert small.rgb.shape == (30, 60, 3)
    assert small.box_px == (15, 10, 45, 20)
    assert shrunk(image, 600) is image
