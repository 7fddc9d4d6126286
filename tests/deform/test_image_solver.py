import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator import quaternions
from animator.deform.anchors import build_anchors
from animator.deform.image_solver import (
    FrameTarget,
    ImageSolver,
    ImageSolverConfig,
    LossWeights,
    _laplacian_smoother,
    project,
)
from animator.deform.pace import PaceConfig
from animator.render.cpu import CpuRenderer
from animator.types import AnchorPoses, Anchors
from tests.helpers.objects import front_camera
from tests.helpers.textured import textured_box

CAMERA = front_camera(3.0, size_px=120)


@pytest.fixture(scope="module")
def box():
    gaussians = textured_box()
    return gaussians, build_anchors(gaussians, target_count=25)


def rigid(anchors: Anchors, degrees: float, shift: list[float]) -> AnchorPoses:
    quat = Rotation.from_euler("z", degrees, degrees=True).as_quat(scalar_first=True)
    quats = torch.tensor(quat, dtype=torch.float32).expand(len(anchors), 4)
    moved = quaternions.rotate(quats, anchors.positions) + torch.tensor(shift)
    return AnchorPoses(quats_wxyz=quats, translations=moved - anchors.positions)


def solver(box, most_steps: int = 50, **weights: float) -> ImageSolver:
    gaussians, anchors = box
    renderer = CpuRenderer()

    def draw(posed, camera):
        rendering = renderer.render(posed, camera)
        return rendering.rgb, rendering.alpha

    config = ImageSolverConfig(
        pace=PaceConfig(most_steps=most_steps),
        weights=dataclasses.replace(LossWeights(), **weights),
    )
    return ImageSolver(gaussians, anchors, draw, config)


def target_of(image_solver: ImageSolver, poses: AnchorPoses) -> FrameTarget:
    with torch.no_grad():
        rgb, alpha = image_solver._draw(image_solver.pose(poses), CAMERA)
    return FrameTarget(rgb=rgb, alpha=alpha, camera=CAMERA, matches=None, object_px=90.0)


def test_recovers_a_small_motion_from_pixels_alone(box):
    gaussians, anchors = box
    image_solver = solver(box, most_steps=100, rest=0.0)
    truth = rigid(anchors, 6.0, [0.05, -0.03, 0.0])
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
    still = ImageSolver(*box, image_solver._draw, ImageSolverConfig(pace=PaceConfig(most_steps=0)))
    start = rigid(box[1], 10.0, [0.1, 0.0, 0.0])
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
        rigid_pairs=lambda step, posed: asked.append((step, posed.means.requires_grad)),
    )
    assert [step for step, _ in asked] == list(range(len(asked)))
    assert 45 <= len(asked) <= 50
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
