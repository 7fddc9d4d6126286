import dataclasses
import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from animator import quaternions
from animator.deform import losses
from animator.deform.robust_norm import RobustNorm
from animator.types import AnchorPoses, Anchors


def chain(count: int = 5) -> Anchors:
    positions = torch.zeros(count, 3)
    positions[:, 0] = torch.arange(count) * 0.25
    positions[:, 1] = torch.tensor([0.0, 0.1, -0.1, 0.2, 0.0])[:count]
    forward = torch.tensor([[i, i + 1] for i in range(count - 1)])
    edges = torch.cat([forward, forward.flip(1)])
    return Anchors(
        positions=positions,
        spacing=0.25,
        skin_ids=torch.zeros(0, 4, dtype=torch.int32),
        skin_weights=torch.zeros(0, 4),
        edges=edges,
        edge_weights=torch.ones(len(edges)),
    )


def rotation(axis: tuple[float, float, float], angle_rad: float) -> torch.Tensor:
    direction = torch.nn.functional.normalize(torch.tensor(axis, dtype=torch.float32), dim=0)
    return torch.cat([torch.tensor([math.cos(angle_rad / 2)]), math.sin(angle_rad / 2) * direction])


def rigid_poses(anchors: Anchors, quat: torch.Tensor, shift: torch.Tensor) -> AnchorPoses:
    quats = quat.expand(len(anchors), 4)
    return AnchorPoses(
        quats_wxyz=quats,
        translations=quaternions.rotate(quats, anchors.positions) + shift - anchors.positions,
    )


angles = st.floats(-3.0, 3.0)
axes = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda a: sum(x * x for x in a) > 0.01)


@settings(max_examples=25, derandomize=True, deadline=None)
@given(axes, angles)
def test_regularizers_vanish_for_rigid_motion(axis, angle_rad):
    anchors = chain()
    poses = rigid_poses(anchors, rotation(axis, angle_rad), torch.tensor([0.3, -2.0, 1.0]))
    assert float(losses.arap_loss(anchors, poses, diagonal=1.0)) < 1e-10
    assert float(losses.rotation_smoothness_loss(anchors, poses)) < 1e-5


def test_arap_of_a_known_stretch():
    anchors = chain()
    shifts = torch.zeros(5, 3)
    shifts[4, 0] = 0.1  # only the last edge, both directions, stretches by 0.1
    poses = dataclasses.replace(AnchorPoses.identity(anchors), translations=shifts)
    expected = 2 * 0.1**2 / 8 / 4.0  # two of eight directed edges, diagonal 2
    assert float(losses.arap_loss(anchors, poses, diagonal=2.0)) == pytest.approx(
        expected, rel=1e-4
    )


def test_rotation_smoothness_is_the_squared_frobenius_distance():
    anchors = chain(2)
    quats = torch.stack([rotation((0, 0, 1), 0.0), rotation((0, 0, 1), 0.7)])
    poses = AnchorPoses(quats_wxyz=quats, translations=torch.zeros(2, 3))
    first, second = quaternions.to_matrices(quats)
    expected = float((first - second).square().sum())
    assert float(losses.rotation_smoothness_loss(anchors, poses)) == pytest.approx(
        expected, rel=1e-4
    )


@settings(max_examples=25, derandomize=True, deadline=None)
@given(axes, angles)
def test_group_loss_vanishes_for_rigid_groups_with_turned_gaussians(axis, angle_rad):
    generator = torch.Generator().manual_seed(3)
    means = torch.randn(12, 3, generator=generator)
    rest_quats = quaternions.normalize(torch.randn(12, 4, generator=generator))
    turn = rotation(axis, angle_rad)
    posed = quaternions.rotate(turn.expand(12, 4), means) + 0.5
    posed_quats = quaternions.multiply(turn.expand(12, 4), rest_quats)
    i, j = torch.arange(0, 6), torch.arange(6, 12)
    value = losses.group_loss(
        means[i] - means[j], rest_quats[i], posed[i] - posed[j], posed_quats[i], diagonal=1.0
    )
    assert float(value) < 1e-9
    # Rotating on the wrong side must not pass: right multiplication is Eq. 2 as printed.
    wrong = quaternions.multiply(rest_quats, turn.expand(12, 4))
    if abs(angle_rad) > 0.2:
        value = losses.group_loss(
            means[i] - means[j], rest_quats[i], posed[i] - posed[j], wrong[i], diagonal=1.0
        )
        assert float(value) > 1e-4


def test_depth_loss_is_huber_and_weighted():
    depths = torch.tensor([2.0, 2.0, 2.0])
    target = torch.tensor([2.001, 1.5, 9.0])
    confidences = torch.tensor([1.0, 3.0, 0.0])
    value = losses.depth_loss(depths, target, confidences, diagonal=0.5)
    expected = (0.5 * 0.002**2 / 0.01 + 3.0 * (1.0 - 0.005)) / 4.0
    assert float(value) == pytest.approx(expected, rel=1e-3)


def test_deformation_loss_is_huber_and_weighted():
    projected = torch.tensor([[0.0, 0.0], [30.0, 40.0]])
    target = torch.tensor([[0.0, 0.5], [0.0, 0.0]])
    confidences = torch.tensor([3.0, 1.0])
    small = 0.5 * (0.5 / 100) ** 2 / 0.01
    large = 0.5 - 0.005
    value = losses.deformation_loss(projected, target, confidences, object_px=100.0)
    assert float(value) == pytest.approx((3 * small + large) / 4, rel=1e-4)
    empty = torch.zeros(0, 2)
    assert float(losses.deformation_loss(empty, empty, torch.zeros(0), object_px=1.0)) == 0.0


def test_image_losses_of_known_differences():
    target = torch.zeros(40, 40, 3)
    rgb = target.clone()
    rgb[:10, :10] = 0.5
    assert float(losses.rgb_loss(rgb, target, area_px=100.0)) == pytest.approx(0.5)
    alpha = torch.zeros(40, 40)
    alpha[:10, :20] = 1.0
    assert float(losses.silhouette_loss(alpha, alpha * 0, area_px=100.0)) == pytest.approx(2.0)
    checker = torch.ones(40, 40, 4)
    checker[::2] = -1.0  # averages to nothing in every cell of even size
    assert float(losses.coarse_image_loss(checker, area_px=1600.0)) == pytest.approx(0.0, abs=1e-6)
    constant = torch.full((40, 40, 4), 0.5)
    assert float(losses.coarse_image_loss(constant, area_px=1600.0)) == pytest.approx(
        4 / 3, rel=1e-4
    )


def test_temporal_loss_measures_lengths():
    anchors = chain()
    rest = AnchorPoses.identity(anchors)
    moved = dataclasses.replace(
        rest, translations=rest.translations + torch.tensor([0.0, 0.2, 0.0])
    )
    assert float(losses.temporal_loss(moved, rest, diagonal=2.0, radius=0.25)) == pytest.approx(
        0.01
    )
    assert float(losses.temporal_loss(rest, rest, diagonal=2.0, radius=0.25)) == 0.0


def test_rest_loss_lets_go_of_what_clearly_moved():
    anchors = chain()
    rest = AnchorPoses.identity(anchors)

    def pull(distance: float) -> float:
        shifts = torch.zeros(5, 3)
        shifts[:, 2] = distance
        moved = dataclasses.replace(rest, translations=shifts)
        return float(losses.rest_loss(moved, diagonal=2.0, norm=RobustNorm(reach=0.03)))

    assert pull(0.002) == pytest.approx(0.001**2, rel=0.01)
    assert pull(0.06) == pytest.approx(0.03**2 / 2, rel=1e-3)
    assert pull(20.0) - pull(2.0) < 1e-6
