"""A box that moves as one body, and the frame that shows it."""

import torch
from scipy.spatial.transform import Rotation

from animator import quaternions
from animator.deform.frame_target import FrameTarget
from animator.deform.image_difference import ImageOnBlack
from animator.deform.image_solver import ImageSolver, ImageSolverConfig
from animator.render.cpu import CpuRenderer
from animator.types import AnchorPoses, Anchors, Gaussians
from tests.helpers.objects import front_camera

CAMERA = front_camera(3.0, size_px=120)


def image_solver_of(
    gaussians: Gaussians, anchors: Anchors, config: ImageSolverConfig
) -> ImageSolver:
    renderer = CpuRenderer()

    def draw(posed, camera):
        rendering = renderer.render(posed, camera)
        return rendering.rgb, rendering.alpha

    return ImageSolver(gaussians, anchors, draw, config)


def rigid(anchors: Anchors, turn: Rotation, shift: list[float]) -> AnchorPoses:
    quat = turn.as_quat(scalar_first=True)
    quats = torch.tensor(quat, dtype=torch.float32).expand(len(anchors), 4)
    moved = quaternions.rotate(quats, anchors.positions) + torch.tensor(shift)
    return AnchorPoses(quats_wxyz=quats, translations=moved - anchors.positions)


def target_of(image_solver: ImageSolver, poses: AnchorPoses) -> FrameTarget:
    with torch.no_grad():
        rgb, alpha = image_solver._draw(image_solver.pose(poses), CAMERA)
    return FrameTarget(
        image=ImageOnBlack(rgb=rgb, alpha=alpha), camera=CAMERA, matches=None, object_px=90.0
    )
