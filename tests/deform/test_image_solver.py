import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.image_solver import (
    ImageSolver,
    ImageSolverConfig,
    LossWeights,
    _laplacian_smoother,
    project,
)
from animator.deform.pace import PaceConfig
from animator.types import AnchorPoses
from tests.helpers.moved_box import CAMERA, image_solver_of, rigid, target_of
from tests.helpers.textured import textured_box


@pytest.fixture(scope="module")
def box():
    gaussians = textured_box()
    return gaussians, build_anchors(gaussians, target_count=25)


def solver(box, most_steps: int = 50, **weights: float) -> ImageSolver:
    config = ImageSolverConfig(
        pace=PaceConfig(most_steps=most_steps),
        weights=dataclasses.replace(LossWeights(), **weights),
    )
    return image_solver_of(*box, config)


def test_recovers_a_small_motion_from_pixels_alone(box):
    gaussians, anchors = box
    image_solver = solver(box, most_steps=100, rest=0.0)
    truth = rigid(anchors, Rotation.from_euler("z", 6, degrees=True), [0.05, -0.03, 0.0])
    target = target_of(image_solver, truth)
    rest = AnchorPoses.identity(anchors)
    solved = image_solver.solve(target, rest, rest)
    wanted = image_solver.pose(truth).means
    error = (image_solver.pose(solved).means - wanted).norm(dim=1).mean()
    motion = (gaussians.means - wanted).norm(dim=1).mean()
    assert float(error / motion) < 0.1
    assert image_solver.image_error(solved, target) < 0.15 * image_solver.image_error(rest, target)


def test_an_explained_frame_moves_nothing(box):
    image_solver = solver(box)
    rest = AnchorPoses.identity(box[1])
    solved = image_solver.solve(target_of(image_solver, rest), rest, rest)
    drift = (image_solver.pose(solved).means - box[0].means).norm(dim=1).max() / box[0].diagonal
    assert float(drift) < 1e-3


def test_no_step_is_the_start(box):
    image_solver = solver(box)
    still = image_solver_of(*box, ImageSolverConfig(pace=PaceConfig(most_steps=0)))
    start = rigid(box[1], Rotation.from_euler("z", 10, degrees=True), [0.1, 0.0, 0.0])
    target = target_of(image_solver, AnchorPoses.identity(box[1]))
    solved = still.solve(target, start, start)
    torch.testing.assert_close(solved.translations, start.translations)
    torch.testing.assert_close(solved.quats_wxyz, start.quats_wxyz)


def test_rigid_pairs_are_asked_for_before_every_step(box):
    image_solver = solver(box)
    rest = AnchorPoses.identity(box[1])
    asked = []
    image_solver.solve(
        target_of(image_solver, rest),
        rest,
        rest,
        rigid_pairs=lambda settled, posed: asked.append((settled, posed.means.requires_grad)),
    )
    assert 45 <= len(asked) <= 50
    settled = [count for count, _ in asked]
    assert settled[0] < 0  # it may still fall
    assert settled[-25:] == list(range(25))
    assert not any(grad for _, grad in asked[1:])


def test_the_smoother_keeps_common_motion_and_damps_single_anchors(box):
    smoother = _laplacian_smoother(box[1], 4.0)
    ones = torch.ones(len(box[1]))
    torch.testing.assert_close(smoother @ ones, ones, rtol=0, atol=1e-4)
    assert float(smoother.diagonal().max()) < 0.7
    torch.testing.assert_close(_laplacian_smoother(box[1], 0.0), torch.eye(len(box[1])))


def test_projection_agrees_with_the_camera(box):
    pixels, _ = CAMERA.project(box[0].means.numpy().astype(np.float64))
    np.testing.assert_allclose(project(box[0].means, CAMERA).numpy(), pixels, atol=1e-3)
