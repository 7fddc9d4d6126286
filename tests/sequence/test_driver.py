import logging

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.match.flow import FlowMatcher
from animator.render.cpu import CpuRenderer
from animator.sequence.driver import ClipProblem, Driver, DriverConfig
from animator.threads import same_bytes_on_any_threads
from animator.types import Camera, Frames, Gaussians
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(3.0, size_px=160)
RENDERER = CpuRenderer()


@pytest.fixture(scope="module")
def box() -> Gaussians:
    return textured_box()


def turned(gaussians: Gaussians, degrees: float) -> Gaussians:
    rotation = Rotation.from_euler("z", degrees, degrees=True)
    means = rotation.apply(gaussians.means.numpy())
    return gaussians.posed(torch.as_tensor(means, dtype=torch.float32), gaussians.quats_wxyz)


def driver(box: Gaussians, frames: Frames, cameras: tuple[Camera, ...], **problem) -> Driver:
    return Driver(
        ClipProblem(
            gaussians=box,
            anchors=build_anchors(box, target_count=25),
            frames=frames,
            cameras=cameras,
            renderer=RENDERER,
            matcher=FlowMatcher(),
            seed=0,
            **problem,
        ),
        DriverConfig(),
    )


def motion(solver: Driver, frame, box: Gaussians) -> np.ndarray:
    return (solver._image_solver.pose(frame.poses).means - box.means).norm(dim=1).numpy()


def test_a_static_clip_does_not_move(box):
    frames = filmed([draw(RENDERER, box, CAMERA)] * 4)
    solver = driver(box, frames, (CAMERA,) * 4)
    solved = [solver.first()]
    list(solver.run(solved))
    assert solved[0].stats.start == "rest"
    for frame in solved:
        assert motion(solver, frame, box).max() / box.diagonal < 2e-3
        assert frame.groups.count == 0


def test_a_turning_box_is_followed_and_the_same_run_gives_the_same_bytes(box):
    angles = [0.0, 3.0, 6.0]
    frames = filmed([draw(RENDERER, turned(box, a), CAMERA) for a in angles])
    runs = []
    for _ in range(2):
        solver = driver(box, frames, (CAMERA,) * 3)
        solved = [solver.first()]
        list(solver.run(solved))
        runs.append(solved)
    wanted = turned(box, angles[-1]).means
    found = solver._image_solver.pose(runs[0][-1].poses).means
    error = (found - wanted).norm(dim=1).mean() / (box.means - wanted).norm(dim=1).mean()
    assert float(error) < 0.1
    assert runs[0][-1].stats.reprojection_px < 1.0
    for first, second in zip(*runs, strict=True):
        assert torch.equal(first.poses.translations, second.poses.translations)
        np.testing.assert_array_equal(first.groups.labels, second.groups.labels)


def test_frame_0_is_solved_where_it_does_not_show_the_rest_pose(box, caplog):
    frames = filmed([draw(RENDERER, turned(box, 14.0), CAMERA)])
    solver = driver(box, frames, (CAMERA,))
    with caplog.at_level(logging.WARNING):
        first = solver.first()
    assert "0000.png" in caplog.text
    wanted = turned(box, 14.0).means
    found = solver._image_solver.pose(first.poses).means
    error = (found - wanted).norm(dim=1).mean() / (box.means - wanted).norm(dim=1).mean()
    assert float(error) < 0.2


def test_a_moving_camera_is_followed_and_the_still_object_stays(box):
    cameras = []
    for k in range(3):
        pose = CAMERA.cam_from_world.copy()
        pose[:3, :3] = Rotation.from_euler("y", 2.0 * k, degrees=True).as_matrix()
        cameras.append(CAMERA.with_pose(pose))
    frames = filmed([draw(RENDERER, box, camera) for camera in cameras])
    solver = driver(box, frames, (CAMERA,) * 3, follow_camera=True)
    with same_bytes_on_any_threads():
        solved = [solver.first()]
        list(solver.run(solved))
    turn = solved[-1].camera.cam_from_world[:3, :3] @ cameras[-1].cam_from_world[:3, :3].T
    # Of four degrees; the box is eighty pixels wide and nearly flat to the camera.
    assert np.degrees(Rotation.from_matrix(turn).magnitude()) < 2.0
    # Taken for a motion of the object, the camera's turn would be 2 % of the diagonal.
    assert motion(solver, solved[-1], box).mean() / box.diagonal < 1e-2
