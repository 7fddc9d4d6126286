import dataclasses
import logging

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.match.flow import FlowMatcher
from animator.match.unexplained import Piece
from animator.render.cpu import CpuRenderer
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.driver import Driver, DriverConfig
from animator.sequence.limb_search import LimbSearchConfig
from animator.threads import same_bytes_on_any_threads
from animator.types import AnchorPoses, Camera, Frames, Gaussians
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(3.0, size_px=160)
RENDERER = CpuRenderer()
NO_SEARCH = LimbSearchConfig(most_swings=0)


@pytest.fixture(scope="module")
def box() -> Gaussians:
    return textured_box()


def turned(gaussians: Gaussians, degrees: float) -> Gaussians:
    rotation = Rotation.from_euler("z", degrees, degrees=True)
    means = rotation.apply(gaussians.means.numpy())
    return gaussians.posed(torch.as_tensor(means, dtype=torch.float32), gaussians.quats_wxyz)


def driver(
    box: Gaussians,
    frames: Frames,
    cameras: tuple[Camera, ...],
    config: DriverConfig | None = None,
    **problem,
) -> Driver:
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
        config or DriverConfig(limb_search=NO_SEARCH),
    )


def motion(solver: Driver, frame, box: Gaussians) -> np.ndarray:
    return (solver._image_solver.pose(frame.poses).means - box.means).norm(dim=1).numpy()


def test_a_static_clip_is_held_and_does_not_move_at_all(box):
    frames = filmed([draw(RENDERER, box, CAMERA)] * 4)
    noise = np.random.default_rng(0).normal(0, 1.5, frames.images.shape)
    noisy = (frames.images + noise).round().clip(0, 255).astype(np.uint8)
    frames = dataclasses.replace(frames, images=noisy)
    solver = driver(box, frames, (CAMERA,) * 4)
    solved = [solver.first()]
    list(solver.run(solved))
    assert [frame.stats.start for frame in solved] == ["rest", "held", "held", "held"]
    assert all(motion(solver, frame, box).max() < 1e-6 for frame in solved)  # rounding of the skin
    assert all(frame.uncertainty is solved[0].uncertainty for frame in solved)


def test_slow_change_is_held_only_until_it_shows(box, monkeypatch):
    """Each frame is one level brighter in three of four channels: noise, from one to the next."""
    rgb, alpha = draw(RENDERER, box, CAMERA)
    frames = filmed([(0.5 * rgb + alpha[..., None] * level / 255, alpha) for level in range(12)])
    solver = driver(box, frames, (CAMERA,) * 12)

    def solve(index, previous, before):
        stats = dataclasses.replace(previous.stats, start=f"solved {index}")
        return dataclasses.replace(previous, stats=stats)

    monkeypatch.setattr(solver, "solve", solve)
    solved = [solver.first()]
    list(solver.run(solved))
    starts = [frame.stats.start for frame in solved]
    # One level and twice the noise, of which two are allowed, make five: six times 3/4 is less.
    assert starts == ["rest", *["held"] * 6, "solved 7", *["held"] * 4]


def test_a_static_frame_that_is_solved_all_the_same_hardly_moves(box):
    frames = filmed([draw(RENDERER, box, CAMERA)] * 3)
    solver = driver(box, frames, (CAMERA,) * 3)
    frame = solver.first()
    assert frame.stats.start == "rest"
    for index in (1, 2):
        frame = solver.solve(index, frame)
        assert motion(solver, frame, box).max() / box.diagonal < 2e-3
        assert frame.groups.count == 0


def test_a_still_picture_of_a_moving_camera_is_solved(box):
    """It shows an object that moves with the camera."""
    aside = CAMERA.cam_from_world.copy()
    aside[0, 3] += 0.05
    frames = filmed([draw(RENDERER, box, CAMERA)] * 2)
    solver = driver(box, frames, (CAMERA, CAMERA.with_pose(aside)))
    solved = [solver.first()]
    list(solver.run(solved))
    assert solved[1].stats.start != "held"
    found = (solver._image_solver.pose(solved[1].poses).means - box.means).mean(dim=0).numpy()
    np.testing.assert_allclose(found, [-0.05, 0, 0], atol=0.015)


def test_every_frame_says_how_well_it_shows_the_anchors(box):
    frames = filmed([draw(RENDERER, turned(box, a), CAMERA) for a in (0.0, 3.0)])
    solver = driver(box, frames, (CAMERA,) * 2)
    solved = [solver.first()]
    list(solver.run(solved))
    for frame in solved:
        assert frame.uncertainty.along_ray.shape == (len(frame.poses.translations),)
        assert (frame.uncertainty.along_ray > frame.uncertainty.across_ray).all()
        assert frame.uncertainty.along_ray.max() < 0.1 * box.diagonal


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


def test_a_solved_frame_is_matched_anew_from_its_own_render(box):
    frames = filmed([draw(RENDERER, turned(box, a), CAMERA) for a in (0.0, 8.0)])
    solver = driver(box, frames, (CAMERA,) * 2)
    rest = solver.first()

    def off_px(frame) -> float:
        target = solver.matched_target_of(1, frame)
        drawn = solver._image_solver.pose(frame.poses).means[target.matches.gaussian_ids]
        drawn_px, _ = target.camera.project(drawn.numpy())
        return float(np.median(np.linalg.norm(drawn_px - target.matches.target_px, axis=1)))

    assert off_px(solver.solve(1, rest)) < 1.0 < 4.0 < off_px(rest)
    unmatched = driver(box, frames, (CAMERA,) * 2, DriverConfig(use_matches=False))
    assert unmatched.matched_target_of(1, rest).matches is None


@pytest.mark.parametrize("continues", [True, False])
def test_motion_is_expected_to_go_on_and_no_more_than_the_frame_shows(box, continues):
    angles = [0.0, 8.0, 16.0, 16.5]
    frames = filmed([draw(RENDERER, turned(box, a), CAMERA) for a in angles])
    config = DriverConfig(use_matches=False, continue_motion=continues, limb_search=NO_SEARCH)
    solver = driver(box, frames, (CAMERA,) * 4, config)
    solved = [solver.first()]
    list(solver.run(solved))
    starts = [frame.stats.start for frame in solved]
    assert starts == ["rest", "previous", "extrapolated" if continues else "previous", "previous"]


@pytest.mark.parametrize(
    ("search", "searches"),
    [
        (LimbSearchConfig(far=0.0, worse=0.0), True),
        (LimbSearchConfig(far=9.0, worse=0.0), False),
        (LimbSearchConfig(far=0.0, worse=1e6), False),
        (LimbSearchConfig(far=0.0, worse=0.0, most_swings=0), False),
    ],
)
def test_limbs_are_searched_for_where_the_step_is_large_and_the_frame_is_badly_explained(
    box, monkeypatch, search, searches
):
    frames = filmed([draw(RENDERER, turned(box, a), CAMERA) for a in (0.0, 8.0)])
    config = DriverConfig(use_matches=False, limb_search=search)
    solver = driver(box, frames, (CAMERA,) * 2, config)
    found = AnchorPoses.identity(solver.problem.anchors)
    monkeypatch.setattr(solver._limb_search, "after_large_step", lambda *_: found)
    solved = [solver.first()]
    list(solver.run(solved))
    assert (solved[1].poses is found) is searches
    assert (solved[1].stats.start == "limb search") is searches
    assert ("limb search" in solved[1].stats.seconds) is searches


@pytest.mark.parametrize(
    ("misses", "in_vain", "starts"),
    [
        (True, False, ["limb search"] * 4),
        (False, False, ["previous"] * 4),
        (True, True, ["previous", "previous", "previous", "limb search"]),
    ],
    ids=["a piece is missing", "nothing is missing", "searched in vain just now"],
)
def test_limbs_are_searched_for_where_a_piece_is_missing_but_not_soon_again_in_vain(
    box, monkeypatch, misses, in_vain, starts
):
    frames = filmed([draw(RENDERER, turned(box, 2.0 * k), CAMERA) for k in range(6)])
    search = LimbSearchConfig(far=9.0, patience=3)
    config = DriverConfig(use_matches=False, continue_motion=False, limb_search=search)
    solver = driver(box, frames, (CAMERA,) * 6, config)
    found = AnchorPoses.identity(solver.problem.anchors)
    missing = Piece(share=0.1, middle_px=np.zeros(2)) if misses else None
    monkeypatch.setattr(solver._limb_search, "missing_piece", lambda *_: missing)
    monkeypatch.setattr(solver._limb_search, "for_piece", lambda *_: found)
    rest = solver.first()
    seconds = {"limb search": 1.0} if in_vain else {}
    stats = dataclasses.replace(rest.stats, start="previous", seconds=seconds)
    solved = [rest, dataclasses.replace(rest, stats=stats)]
    list(solver.run(solved))
    assert [frame.stats.start for frame in solved[2:]] == starts


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
