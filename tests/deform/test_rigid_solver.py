"""A rigid object is found by six unknowns."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.image_solver import ImageSolverConfig
from animator.deform.pace import PaceConfig
from animator.deform.rigid_solver import RigidSolverConfig, solve_rigid
from animator.types import AnchorPoses, GaussianMatches
from tests.helpers.moved_box import CAMERA, image_solver_of, rigid, target_of
from tests.helpers.textured import textured_box

TURN = Rotation.from_euler("zy", [4, 2], degrees=True)
CONFIG = RigidSolverConfig(pace=PaceConfig(most_steps=100))


@pytest.fixture(scope="module")
def box():
    gaussians = textured_box()
    anchors = build_anchors(gaussians, target_count=30)
    return image_solver_of(gaussians, anchors, ImageSolverConfig()), anchors


def test_a_small_motion_is_found_and_stays_rigid(box):
    image_solver, anchors = box
    truth = rigid(anchors, TURN, [0.04, -0.03, 0.02])
    start = AnchorPoses.identity(anchors)
    found = solve_rigid(image_solver, anchors, target_of(image_solver, truth), start, CONFIG)
    wanted, got = (image_solver.pose(pose).means for pose in (truth, found))
    motion = (image_solver.gaussians.means - wanted).norm(dim=1).mean()
    assert float((got - wanted).norm(dim=1).mean() / motion) < 0.1
    places = anchors.positions + found.translations
    torch.testing.assert_close(torch.pdist(places), torch.pdist(anchors.positions))
    np.testing.assert_allclose(found.quats_wxyz.std(dim=0), 0.0, atol=1e-6)


def test_what_explains_the_frame_is_kept(box):
    image_solver, anchors = box
    start = rigid(anchors, TURN, [0.04, -0.03, 0.0])
    found = solve_rigid(image_solver, anchors, target_of(image_solver, start), start, CONFIG)
    assert found is start


def test_matches_tell_what_the_picture_does_not_and_wrong_ones_do_no_harm(box):
    image_solver, anchors = box
    truth = rigid(anchors, TURN, [0.04, -0.03, 0.02])
    wanted = image_solver.pose(truth).means
    ids = np.arange(0, len(wanted), 5)
    target_px, _ = CAMERA.project(wanted[ids].numpy().astype(np.float64))
    target_px[::8] += [6.0, -4.0]
    matches = GaussianMatches(gaussian_ids=ids, target_px=target_px, confidences=np.ones(len(ids)))
    target = target_of(image_solver, truth)
    hidden = target.limited_to(torch.zeros_like(target.image.alpha))
    start = AnchorPoses.identity(anchors)

    def error(matches: GaussianMatches | None) -> float:
        told = dataclasses.replace(hidden, matches=matches)
        found = image_solver.pose(solve_rigid(image_solver, anchors, told, start, CONFIG)).means
        motion = (image_solver.gaussians.means - wanted).norm(dim=1).mean()
        return float((found - wanted).norm(dim=1).mean() / motion)

    assert error(matches) < 0.15
    assert error(None) == pytest.approx(1.0)
    assert error(matches.take(ids[:0])) == pytest.approx(1.0)
