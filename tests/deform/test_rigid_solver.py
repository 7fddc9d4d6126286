"""A rigid object is found by six unknowns."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator import quaternions
from animator.deform.anchors import build_anchors
from animator.deform.image_solver import FrameTarget, ImageSolver, ImageSolverConfig
from animator.deform.pace import PaceConfig
from animator.deform.rigid_solver import RigidSolverConfig, solve_rigid
from animator.render.cpu import CpuRenderer
from animator.types import AnchorPoses
from tests.helpers.objects import front_camera
from tests.helpers.textured import textured_box

CAMERA = front_camera(3.0, size_px=120)
CONFIG = RigidSolverConfig(pace=PaceConfig(most_steps=100))


@pytest.fixture(scope="module")
def box():
    gaussians = textured_box()
    anchors = build_anchors(gaussians, target_count=30)
    renderer = CpuRenderer()

    def draw(posed, camera):
        rendering = renderer.render(posed, camera)
        return rendering.rgb, rendering.alpha

    return ImageSolver(gaussians, anchors, draw, ImageSolverConfig()), anchors


def turned(anchors, degrees: float, shift: list[float]) -> AnchorPoses:
    quat = Rotation.from_euler("zy", [degrees, degrees / 2], degrees=True).as_quat(
        scalar_first=True
    )
    quats = torch.tensor(quat, dtype=torch.float32).expand(len(anchors), 4)
    moved = quaternions.rotate(quats, anchors.positions) + torch.tensor(shift)
    return AnchorPoses(quats_wxyz=quats, translations=moved - anchors.positions)


def target_of(image_solver: ImageSolver, poses: AnchorPoses) -> FrameTarget:
    with torch.no_grad():
        rgb, alpha = image_solver._draw(image_solver.pose(poses), CAMERA)
    return FrameTarget(rgb=rgb, alpha=alpha, camera=CAMERA, matches=None, object_px=90.0)


def test_a_small_motion_is_found_and_stays_rigid(box):
    image_solver, anchors = box
    truth = turned(anchors, 4.0, [0.04, -0.03, 0.02])
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
    start = turned(anchors, 4.0, [0.04, -0.03, 0.0])
    found = solve_rigid(image_solver, anchors, target_of(image_solver, start), start, CONFIG)
    assert found is start
