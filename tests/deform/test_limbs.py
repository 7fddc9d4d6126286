import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.limbs import find_limbs, line_of, turned
from animator.types import AnchorPoses
from tests.helpers.objects import box_points, front_camera, gaussians_at


@pytest.fixture(scope="module")
def anchors():
    """A body with an arm to the right of it."""
    body = box_points((0, 0, 0), (0.8, 1.6, 0.8), 1500, 0)
    arm = box_points((0.9, 0, 0), (1.0, 0.2, 0.2), 400, 1)
    return build_anchors(gaussians_at(np.concatenate([body, arm])), target_count=60)


def arms(anchors, *lengths):
    end = anchors.positions[:, 0].argmax()
    return [limb for limb in find_limbs(anchors, lengths) if limb.tip == end]


def test_finds_the_arm_in_each_length(anchors):
    sizes = [limb.shares.sum() for limb in arms(anchors, 0.3, 0.45, 0.6, 0.75)]
    assert len(sizes) >= 3
    assert sizes == sorted(sizes)


def test_a_limb_is_what_lies_beyond_its_base(anchors):
    (arm,) = arms(anchors, 0.5)
    x = anchors.positions[:, 0].numpy()
    assert x[arm.shares == 1].min() > x[arm.base].mean() > x[arm.shares == 0].max() - 0.4
    assert ((arm.shares >= 0) & (arm.shares <= 1)).all()


def test_a_body_without_any_limb_has_none_of_one_anchor():
    ball = box_points((0, 0, 0), (1, 1, 1), 800, 0)
    anchors = build_anchors(gaussians_at(ball), target_count=8)
    assert all((limb.shares > 0.5).sum() >= 2 for limb in find_limbs(anchors, (0.3, 0.5, 0.9)))


def test_the_line_of_a_limb_runs_from_its_base_outward(anchors):
    (arm,) = arms(anchors, 0.5)
    line = line_of(arm, anchors, AnchorPoses.identity(anchors), front_camera(6.0))
    assert line.direction[0] > 0.9 * np.linalg.norm(line.direction)
    assert np.linalg.norm(line.ray) == pytest.approx(1.0)
    assert line.ray[2] > 0.9


def test_turns_as_one_piece_about_its_base_and_leaves_the_rest(anchors):
    (arm,) = arms(anchors, 0.5)
    rest = AnchorPoses.identity(anchors)
    rotvec = np.array([0.2, -0.7, 0.4])
    base = np.array([0.4, 0.0, 0.0])
    poses = turned(arm, anchors, rest, base, rotvec)
    places = anchors.positions.numpy().astype(np.float64)
    after = places + poses.translations.numpy()
    whole, none = arm.shares == 1, arm.shares == 0
    wanted = base + Rotation.from_rotvec(rotvec).apply(places[whole] - base)
    np.testing.assert_allclose(after[whole], wanted, atol=1e-6)
    np.testing.assert_array_equal(after[none], places[none])
    quats = poses.quats_wxyz.numpy()
    np.testing.assert_allclose(
        Rotation.from_quat(quats[whole], scalar_first=True).as_rotvec(),
        np.tile(rotvec, (whole.sum(), 1)),
        atol=1e-6,
    )
    # And turned back it is where it was.
    back = turned(arm, anchors, poses, base, -rotvec)
    np.testing.assert_allclose(back.translations.numpy(), 0, atol=1e-6)
