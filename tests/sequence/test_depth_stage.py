"""Depth maps that the user gives: calibrated by frame 0, and followed."""

import dataclasses
import logging

import numpy as np
import pytest
import torch
from scipy.interpolate import NearestNDInterpolator
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors, with_sharper_skin
from animator.match.flow import FlowMatcher
from animator.render.cpu import CpuRenderer
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.driver import Driver, DriverConfig
from animator.types import AnchorPoses, Gaussians
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(3.0, size_px=128)
RENDERER = CpuRenderer()


@pytest.fixture(scope="module")
def box() -> Gaussians:
    """A box whose front is seen askew, so that its depth varies."""
    box = textured_box()
    turn = Rotation.from_euler("y", 35, degrees=True)
    return box.posed(
        torch.as_tensor(turn.apply(box.means.numpy()), dtype=torch.float32), box.quats_wxyz
    )


def bent(box: Gaussians) -> Gaussians:
    """Its upper half leans toward the camera: across the rays next to nothing changes."""
    means = box.means.clone()
    means[:, 2] += 0.6 * means[:, 1].clamp_min(0.0)
    return box.posed(means, box.quats_wxyz)


def depth_map(box: Gaussians) -> np.ndarray:
    seen = RENDERER.visibility(box, CAMERA)
    front = seen.visible_shares > 0.3
    pixels = np.stack(np.meshgrid(np.arange(128) + 0.5, np.arange(128) + 0.5), axis=-1)
    depths = NearestNDInterpolator(seen.centres_px[front], seen.depths[front])(pixels)
    return np.where(draw(RENDERER, box, CAMERA)[1] > 0.5, depths, np.nan)


def driver(box: Gaussians, depth_maps: list[np.ndarray] | None) -> Driver:
    frames = filmed([draw(RENDERER, shown, CAMERA) for shown in (box, bent(box))])
    if depth_maps is not None:
        frames = dataclasses.replace(frames, depths=np.stack(depth_maps).astype(np.float32))
    problem = ClipProblem(
        gaussians=box,
        anchors=build_anchors(box, target_count=30),
        frames=frames,
        cameras=(CAMERA,) * 2,
        renderer=RENDERER,
        matcher=FlowMatcher(),
        seed=0,
    )
    return Driver(problem, DriverConfig(use_matches=False))


def error(solver: Driver, box: Gaussians) -> float:
    """Error of what is seen of the second frame, solved, as a share of its motion."""
    solved = [solver.first()]
    list(solver.run(solved))
    seen = RENDERER.visibility(bent(box), CAMERA).visible_shares > 0.3
    found = solver._image_solver.pose(solved[1].poses).means[seen]
    rest, wanted = box.means[seen], bent(box).means[seen]
    return float((found - wanted).norm(dim=1).mean() / (rest - wanted).norm(dim=1).mean())


@pytest.mark.parametrize("is_inverse", [False, True])
def test_depth_on_any_scale_shows_what_the_picture_does_not(box, is_inverse):
    maps = [depth_map(box), depth_map(bent(box))]
    if is_inverse:
        maps = [40.0 / depth + 3.0 for depth in maps]
    assert error(driver(box, maps), box) < 0.6 * error(driver(box, None), box)


def test_what_a_network_always_gets_wrong_drops_out(box):
    rows = np.linspace(0.0, 1.0, 128)[:, None] ** 2
    maps = [depth_map(shown) + 0.3 * rows for shown in (box, bent(box))]
    solver = driver(box, maps)
    rest = AnchorPoses.identity(solver.problem.anchors)
    solver._depth_stage.calibrate(rest, CAMERA)
    still = dataclasses.replace(solver.first(), poses=rest)
    found = solver.target_of(0, still).depths
    true = RENDERER.visibility(box, CAMERA).depths[found.gaussian_ids]
    np.testing.assert_allclose(found.depths, true, atol=1e-6)


def test_a_map_that_is_not_of_this_object_is_not_believed(box, caplog):
    solver = driver(box, list(np.random.default_rng(0).uniform(1.0, 2.0, (2, 128, 128))))
    with caplog.at_level(logging.WARNING):
        solver._depth_stage.calibrate(AnchorPoses.identity(solver.problem.anchors), CAMERA)
    assert "no depth map is used" in caplog.text
    assert solver.target_of(1, solver.first()).depths is None


def test_a_map_on_another_scale_is_left_out_with_one_warning(box, caplog):
    solver = driver(box, [depth_map(box), 2.0 * depth_map(bent(box))])
    still = solver.first()
    solver._depth_stage.calibrate(still.poses, CAMERA)
    with caplog.at_level(logging.WARNING):
        assert solver.target_of(1, still).depths is None
        assert solver.target_of(1, still).depths is None
    assert caplog.text.count("not on the scale") == 1


def test_nothing_is_asked_of_a_clip_without_maps(box):
    solver = driver(box, None)
    solver._depth_stage.calibrate(AnchorPoses.identity(solver.problem.anchors), CAMERA)
    assert solver.target_of(1, solver.first()).depths is None


def test_a_driver_with_another_skin_knows_the_depths_too(box):
    solver = driver(box, [depth_map(box), depth_map(bent(box))])
    solved = [solver.first()]
    list(solver.run(solved))
    anchors = with_sharper_skin(solver.problem.anchors, 4.0)
    other = solver.with_anchors(anchors, solved[0])
    assert other.problem.anchors is anchors
    known, same = (each.target_of(1, solved[1]).depths for each in (other, solver))
    assert known is not None
    assert same is not None
    assert np.median(known.depths) == pytest.approx(np.median(same.depths), rel=0.01)
