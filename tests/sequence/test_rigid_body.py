"""Clips of one rigid body, and those that only nearly are."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.sequence.rigid_body import RigidBodyConfig, as_rigid_body
from animator.types import AnchorPoses
from tests.helpers.textured import textured_box

FRAMES = 6


@pytest.fixture(scope="module")
def anchors():
    return build_anchors(textured_box(), target_count=60)


def turns() -> list[Rotation]:
    return [
        Rotation.from_rotvec(0.1 * frame * np.array([0.2, 0.9, -0.1])) for frame in range(FRAMES)
    ]


def solved(anchors, bend: np.ndarray) -> list[AnchorPoses]:
    """A turning and drifting box whose anchors are off by `bend`, (T, A, 3)."""
    rest = anchors.positions.numpy().astype(np.float64)
    return [
        AnchorPoses(
            quats_wxyz=torch.as_tensor(
                np.tile(turn.as_quat(scalar_first=True), (len(rest), 1)), dtype=torch.float32
            ),
            translations=torch.as_tensor(
                turn.apply(rest) + 0.05 * frame - rest + bend[frame], dtype=torch.float32
            ),
        )
        for frame, turn in enumerate(turns())
    ]


def diagonal(anchors) -> float:
    return float(np.linalg.norm(np.ptp(anchors.positions.numpy(), axis=0)))


def noise(anchors, size: float) -> np.ndarray:
    shape = (FRAMES, len(anchors), 3)
    return np.random.default_rng(0).normal(0.0, size * diagonal(anchors), shape)


def test_a_shivering_rigid_body_comes_out_rigid_and_nearer_to_the_truth(anchors):
    exact = solved(anchors, np.zeros((FRAMES, len(anchors), 3)))
    rigid = as_rigid_body(
        solved(anchors, noise(anchors, 1e-3)), anchors, diagonal(anchors), RigidBodyConfig()
    )
    assert rigid is not None
    for pose, truth, turn in zip(rigid, exact, turns(), strict=True):
        assert (pose.quats_wxyz == pose.quats_wxyz[0]).all()
        found = Rotation.from_quat(pose.quats_wxyz[0].numpy(), scalar_first=True)
        assert (found * turn.inv()).magnitude() < 2e-3
        shifted = (pose.translations - truth.translations).norm(dim=1).max()
        assert float(shifted) < 2e-3 * diagonal(anchors)
        lengths = torch.pdist(anchors.positions + pose.translations)
        torch.testing.assert_close(lengths, torch.pdist(anchors.positions))


def test_a_part_that_moves_by_itself_keeps_its_motion(anchors):
    bend = np.zeros((FRAMES, len(anchors), 3))
    first, second = anchors.edges.numpy().T
    bend[3, [0, *second[first == 0]], 1] = 0.02 * diagonal(anchors)
    assert (
        as_rigid_body(solved(anchors, bend), anchors, diagonal(anchors), RigidBodyConfig()) is None
    )


def test_one_anchor_that_went_astray_is_brought_back(anchors):
    bend = np.zeros((FRAMES, len(anchors), 3))
    bend[3, 0, 1] = 0.02 * diagonal(anchors)
    rigid = as_rigid_body(solved(anchors, bend), anchors, diagonal(anchors), RigidBodyConfig())
    assert rigid is not None
    true = solved(anchors, np.zeros_like(bend))[3].translations[0]
    assert float((rigid[3].translations[0] - true).norm()) < 0.002 * diagonal(anchors)


def test_a_bend_as_large_as_the_motion_is_no_noise(anchors):
    tracks = [
        dataclasses.replace(
            AnchorPoses.identity(anchors), translations=torch.as_tensor(bend, dtype=torch.float32)
        )
        for bend in noise(anchors, 1e-3)
    ]
    assert as_rigid_body(tracks, anchors, diagonal(anchors), RigidBodyConfig()) is None


def test_zero_switches_it_off(anchors):
    still = solved(anchors, np.zeros((FRAMES, len(anchors), 3)))
    off = RigidBodyConfig(residual=0.0)
    assert as_rigid_body(still, anchors, diagonal(anchors), off) is None
