"""Nodes move what they hold together, and find what anchors alone are slow to find."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors, distances_between
from animator.deform.coarse_motion import CoarseConfig, NodeLevel
from animator.deform.image_solver import ImageSolverConfig, LossWeights, project
from animator.deform.pace import PaceConfig
from animator.types import AnchorPoses, Anchors
from tests.helpers.moved_box import CAMERA, image_solver_of, rigid, target_of
from tests.helpers.textured import textured_box


@pytest.fixture(scope="module")
def box():
    gaussians = textured_box()
    return gaussians, build_anchors(gaussians, target_count=40)


def at_rest(anchors: Anchors) -> tuple[torch.Tensor, torch.Tensor]:
    return anchors.positions, AnchorPoses.identity(anchors).quats_wxyz


def begun(anchors: Anchors, count: int):
    level = NodeLevel(anchors, distances_between(anchors), count, 1.0, CoarseConfig())
    motion = level.begin(anchors.positions, CAMERA)
    (turns,), (shifts,), (dilations,) = (group["params"] for group in motion.unknowns)
    return motion, turns, shifts, dilations


@pytest.mark.parametrize("count", [1, 4, 1000])
def test_nothing_moves_at_first(box, count):
    motion, turns, _, _ = begun(box[1], count)
    assert len(turns) == min(count, len(box[1]))
    for moved, still in zip(motion(*at_rest(box[1])), at_rest(box[1]), strict=True):
        torch.testing.assert_close(moved, still, rtol=0, atol=0)


def test_one_node_turns_and_shifts_everything_as_one_body(box):
    anchors = box[1]
    motion, turns, shifts, _ = begun(anchors, 1)
    with torch.no_grad():
        turns += torch.tensor([0.1, -0.2, 0.3])
        shifts += torch.tensor([0.4, 0.0, -0.1])
    places, quats = motion(*at_rest(anchors))
    torch.testing.assert_close(torch.pdist(places), torch.pdist(anchors.positions))
    torch.testing.assert_close(quats, quats[:1].expand_as(quats))
    middle = anchors.positions.mean(dim=0) + torch.tensor([0.4, 0.0, -0.1])
    torch.testing.assert_close(places.mean(dim=0), middle)


def test_no_image_sees_a_dilation(box):
    anchors = box[1]
    motion, _, _, dilations = begun(anchors, 1)
    with torch.no_grad():
        dilations += 0.2
        places, _ = motion(*at_rest(anchors))
    torch.testing.assert_close(project(places, CAMERA), project(anchors.positions, CAMERA))
    farther = (places - torch.as_tensor(CAMERA.position).to(places)).norm(dim=1)
    nearer = (anchors.positions - torch.as_tensor(CAMERA.position).to(places)).norm(dim=1)
    np.testing.assert_allclose(farther / nearer, np.exp(0.2), rtol=1e-5)


def test_a_node_moves_what_is_near_and_leaves_what_is_far(box):
    anchors = box[1]
    motion, _, shifts, _ = begun(anchors, 6)
    with torch.no_grad():
        shifts[2] += torch.tensor([0.0, 0.1, 0.0])
        lifts = (motion(*at_rest(anchors))[0] - anchors.positions)[:, 1]
    assert 0.08 < float(lifts.max()) <= 0.1
    assert 0.0 <= float(lifts.min()) < 1e-3


def test_a_body_that_recedes_is_found_where_it_is(box):
    """It looks smaller: shrunken where it was, or farther away? Only its stiffness tells."""
    gaussians, anchors = box
    away = 0.25 * (anchors.positions.mean(dim=0).numpy() - CAMERA.position)
    truth = rigid(anchors, Rotation.identity(), away.tolist())

    def error(nodes: tuple[int, ...]) -> float:
        weights = dataclasses.replace(LossWeights(), rest=0.0)
        config = ImageSolverConfig(
            pace=PaceConfig(most_steps=100), coarse=CoarseConfig(nodes=nodes), weights=weights
        )
        image_solver = image_solver_of(gaussians, anchors, config)
        rest = AnchorPoses.identity(anchors)
        solved = image_solver.solve(target_of(image_solver, truth), rest, rest)
        off = (solved.translations - truth.translations).norm(dim=1).mean()
        return float(off / truth.translations.norm(dim=1).mean())

    assert error((10, 1)) < 0.02
    assert error(()) > 0.2  # 0.003 and 0.44
