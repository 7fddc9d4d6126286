import math

import numpy as np
import pytest
import torch

from animator import quaternions
from animator.deform.anchors import build_anchors
from animator.sequence.interpolation import InterpolationConfig, blend, interpolate
from animator.types import AnchorPoses, RigidGroups
from tests.helpers.objects import box_points, gaussians_at


@pytest.fixture(scope="module")
def bar():
    return build_anchors(
        gaussians_at(box_points((0, 0, 0), (2.0, 0.4, 0.4), 900, 0)), target_count=30
    )


def turned(anchors, angle_deg: float, where: torch.Tensor) -> AnchorPoses:
    """Turn the chosen anchors about z through the origin."""
    half = math.radians(angle_deg) / 2
    quat = torch.tensor([math.cos(half), 0.0, 0.0, math.sin(half)]).expand(len(anchors), 4)
    identity = AnchorPoses.identity(anchors).quats_wxyz
    quats = torch.where(where[:, None], quat, identity)
    return AnchorPoses(
        quats_wxyz=quats,
        translations=quaternions.rotate(quats, anchors.positions) - anchors.positions,
    )


def ungrouped(anchors) -> RigidGroups:
    return RigidGroups(labels=np.full(len(anchors), -1))


def test_blend_meets_both_ends_and_halves_the_angle(bar):
    start = AnchorPoses.identity(bar)
    end = turned(bar, 100, torch.ones(len(bar), dtype=torch.bool))
    for share, pose in ((0.0, start), (1.0, end)):
        torch.testing.assert_close(blend(start, end, share).quats_wxyz, pose.quats_wxyz)
        torch.testing.assert_close(blend(start, end, share).translations, pose.translations)
    middle = blend(start, end, 0.5).quats_wxyz[0]
    assert 2 * math.degrees(math.acos(middle[0])) == pytest.approx(50, abs=1e-3)
    flipped = AnchorPoses(quats_wxyz=-end.quats_wxyz, translations=end.translations)
    assert 2 * math.degrees(
        math.acos(blend(start, flipped, 0.5).quats_wxyz[0, 0])
    ) == pytest.approx(50, abs=1e-3)


def test_a_half_turned_bar_keeps_its_length_where_a_blend_shrinks_it(bar):
    everything = torch.ones(len(bar), dtype=torch.bool)
    start, end = AnchorPoses.identity(bar), turned(bar, 120, everything)
    ((middle,),) = interpolate(bar, ungrouped(bar), [start, end], 1, InterpolationConfig())

    def length(poses: AnchorPoses) -> float:
        points = bar.positions + poses.translations
        ends = bar.positions[:, 0].argmin(), bar.positions[:, 0].argmax()
        return float((points[ends[0]] - points[ends[1]]).norm())

    rest = length(start)
    assert length(blend(start, end, 0.5)) < 0.6 * rest  # cos(60 degrees)
    assert length(middle) == pytest.approx(rest, rel=0.05)


def test_count_order_and_determinism(bar):
    start = AnchorPoses.identity(bar)
    end = turned(bar, 60, bar.positions[:, 0] > 0)
    runs = [
        interpolate(bar, ungrouped(bar), [start, end], 3, InterpolationConfig())[0]
        for _ in range(2)
    ]
    assert [len(run) for run in runs] == [3, 3]
    tip = int(bar.positions[:, 0].argmax())
    heights = [float(pose.translations[tip, 1]) for pose in runs[0]]
    assert heights == sorted(heights)
    assert heights[0] > 0 and heights[-1] < float(end.translations[tip, 1])
    for first, second in zip(*runs, strict=True):
        torch.testing.assert_close(first.translations, second.translations, rtol=0, atol=0)


def test_equal_keys_give_equal_in_betweens(bar):
    pose = turned(bar, 30, torch.ones(len(bar), dtype=torch.bool))
    for between in interpolate(bar, ungrouped(bar), [pose, pose], 2, InterpolationConfig())[0]:
        torch.testing.assert_close(between.translations, pose.translations, atol=1e-4, rtol=0)


def test_what_is_bent_in_both_keys_stays_bent_between_them(bar):
    right = bar.positions[:, 0] > 0
    bent = turned(bar, 70, right)
    everywhere = turned(bar, 40, torch.ones(len(bar), dtype=torch.bool))
    points = quaternions.rotate(everywhere.quats_wxyz, bar.positions + bent.translations)
    bent_and_turned = AnchorPoses(
        quats_wxyz=quaternions.multiply(everywhere.quats_wxyz, bent.quats_wxyz),
        translations=points - bar.positions,
    )
    config = InterpolationConfig()
    for between in interpolate(bar, ungrouped(bar), [bent, bent_and_turned], 3, config)[0]:
        torch.testing.assert_close(
            torch.pdist(bar.positions + between.translations),
            torch.pdist(bar.positions + bent.translations),
            atol=0.02,
            rtol=0,
        )


def test_rigid_groups_hold_better_with_their_loss(bar):
    right = bar.positions[:, 0] > 0
    start, end = AnchorPoses.identity(bar), turned(bar, 110, right)
    grouped = RigidGroups(labels=np.where(right.numpy(), 0, -1))
    soft = InterpolationConfig(rigidity=20.0)

    def strain(groups: RigidGroups) -> float:
        ((middle,),) = interpolate(bar, groups, [start, end], 1, soft)
        rest = torch.cdist(bar.positions[right], bar.positions[right])
        points = (bar.positions + middle.translations)[right]
        return float((torch.cdist(points, points) - rest).abs().mean())

    assert strain(grouped) < 0.7 * strain(ungrouped(bar))


def test_a_curve_through_all_keys_goes_on_where_lines_would_break(bar):
    everything = torch.ones(len(bar), dtype=torch.bool)
    keys = [turned(bar, angle, everything) for angle in (0, 10, 40, 90, 160)]  # 10 k^2 degrees
    gaps = interpolate(bar, ungrouped(bar), keys, 1, InterpolationConfig())
    halves = [float(between.quats_wxyz[0, 0].abs()) for (between,) in gaps]
    angles = [2 * math.degrees(math.acos(half)) for half in halves]
    for angle, middle in zip(angles[1:-1], (1.5, 2.5), strict=True):
        assert angle == pytest.approx(10 * middle**2, abs=2.0)  # a line is 2.5 degrees off
    halfway = turned(bar, 62.5, everything)
    torch.testing.assert_close(gaps[2][0].translations, halfway.translations, atol=0.04, rtol=0)


def test_nothing_swings_past_a_stop(bar):
    everything = torch.ones(len(bar), dtype=torch.bool)
    keys = [turned(bar, angle, everything) for angle in (0, 20, 40, 40, 40, 40)]
    stopped = interpolate(bar, ungrouped(bar), keys, 3, InterpolationConfig())[3:]
    for between in (pose for gap in stopped for pose in gap):
        torch.testing.assert_close(between.translations, keys[-1].translations, atol=1e-4, rtol=0)
