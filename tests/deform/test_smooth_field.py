"""A smooth field moves what is near alike, and explains a frame no further than that."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.coarse_motion import CoarseConfig
from animator.deform.image_solver import ImageSolverConfig, LossWeights
from animator.deform.pace import PaceConfig
from animator.deform.smooth_field import SmoothField, SmoothFieldConfig
from animator.types import AnchorPoses, Anchors
from tests.helpers.moved_box import CAMERA, image_solver_of, rigid, target_of
from tests.helpers.textured import textured_box

FEW = SmoothFieldConfig(coarse=CoarseConfig(nodes=(12, 1)))


@pytest.fixture(scope="module")
def box():
    gaussians = textured_box()
    return gaussians, build_anchors(gaussians, target_count=60)


def bent(anchors: Anchors, sag: float = 0.3) -> AnchorPoses:
    """Lower the ends of the box along a parabola, by `sag` at one unit from the middle."""
    x = anchors.positions[:, 0].numpy()
    turns = Rotation.from_euler("z", np.arctan(-2.0 * sag * x)[:, None])
    shifts = np.zeros((len(x), 3))
    shifts[:, 1] = -sag * x**2
    return AnchorPoses(
        quats_wxyz=torch.as_tensor(turns.as_quat(scalar_first=True), dtype=torch.float32),
        translations=torch.as_tensor(shifts, dtype=torch.float32),
    )


def distance(one: AnchorPoses, other: AnchorPoses) -> float:
    return float((one.translations - other.translations).norm(dim=1).mean())


def test_a_body_and_a_smooth_bend_are_smooth_fields(box):
    field = SmoothField(box[1], 1.0, FEW)
    for pose in (rigid(box[1], Rotation.from_euler("y", 0.3), [0.1, 0.0, 0.2]), bent(box[1])):
        motion = float(pose.translations.norm(dim=1).mean())
        assert distance(field.near(pose, CAMERA), pose) < 0.1 * motion


def test_neighbors_that_move_against_each_other_are_not(box):
    anchors = box[1]
    signs = torch.where(torch.arange(len(anchors)) % 2 == 0, 1.0, -1.0)
    pose = AnchorPoses.identity(anchors)
    pose.translations[:, 2] = 0.1 * signs
    near = SmoothField(anchors, 1.0, FEW).near(pose, CAMERA)
    assert distance(near, pose) > 0.07


def test_an_anchor_that_went_astray_is_left_alone(box):
    anchors = box[1]
    pose = bent(anchors)
    pose.translations[7] += torch.tensor([0.0, 0.0, 1.0])
    near = SmoothField(anchors, 1.0, FEW).near(pose, CAMERA)
    assert distance(near, bent(anchors)) < 0.02


def test_what_does_not_hang_together_moves_alike_where_it_is_near():
    """Two sheets, one close behind the other, without an edge between them."""
    x, y = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))
    sheet = np.stack([x.ravel(), y.ravel(), np.zeros(81)], axis=1)
    places = torch.as_tensor(
        np.concatenate([sheet, sheet + np.array([0, 0, 0.05])]), dtype=torch.float32
    )
    anchors = Anchors(
        positions=places,
        spacing=0.25,
        skin_ids=torch.zeros(0, 4, dtype=torch.int32),
        skin_weights=torch.zeros(0, 4),
        edges=torch.tensor([[0, 1], [1, 0]]),
        edge_weights=torch.ones(2),
    )
    pose = AnchorPoses.identity(anchors)
    pose.translations[:81, 2] = 0.1
    field = SmoothField(anchors, 1.0, FEW)
    near = field.near(pose, CAMERA).translations[:, 2]
    np.testing.assert_allclose(near[:81], near[81:], atol=0.03)
    waves = 0.1 * torch.sin(3.0 * places[:, 0])
    pose.translations[:, 2] = waves
    near = field.near(pose, CAMERA).translations[:, 2]
    assert (near - waves).abs().mean() < 0.2 * waves.abs().mean()


def test_a_bend_is_found_in_the_picture(box):
    gaussians, anchors = box
    config = ImageSolverConfig(
        pace=PaceConfig(most_steps=120), weights=LossWeights(rest=0.0, arap=20.0)
    )
    image_solver = image_solver_of(gaussians, anchors, config)
    target = target_of(image_solver, bent(anchors))
    start = AnchorPoses.identity(anchors)
    found = SmoothField(anchors, gaussians.diagonal, FEW).solve(image_solver, target, start)
    before, after = (image_solver.image_error(pose, target) for pose in (start, found))
    assert after < 0.3 * before
    near = SmoothField(anchors, gaussians.diagonal, FEW).near(found, CAMERA)
    assert distance(near, found) < 0.02 * distance(found, start)
    torch.testing.assert_close(found.quats_wxyz.norm(dim=1), torch.ones(len(anchors)))
