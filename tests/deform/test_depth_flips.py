import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.depth_flips import FlipConfig, flipped_poses
from animator.deform.limbs import find_limbs
from animator.types import AnchorPoses
from tests.helpers.objects import box_points, front_camera, gaussians_at

CAMERA = front_camera(30.0)
"""So far away that depth hardly changes the picture."""
CONFIG = FlipConfig()


@pytest.fixture(scope="module")
def anchors():
    """A body with an arm to the right of it."""
    body = box_points((0, 0, 0), (0.8, 1.6, 0.8), 1500, 0)
    arm = box_points((0.9, 0, 0), (1.0, 0.2, 0.2), 400, 1)
    return build_anchors(gaussians_at(np.concatenate([body, arm])), target_count=60)


def in_the_arm(anchors) -> np.ndarray:
    return anchors.positions.numpy()[:, 0] > 0.7


def leaning(anchors, degrees: float) -> AnchorPoses:
    """The arm turned about the y axis at its root: positive angles lean away from the camera."""
    turn = Rotation.from_euler("y", -degrees, degrees=True)
    root = np.array([0.4, 0, 0])
    rest = anchors.positions.numpy().astype(np.float64)
    is_arm = rest[:, :1] > 0.4
    moved = np.where(is_arm, root + turn.apply(rest - root), rest) - rest
    quats = np.where(is_arm, turn.as_quat(scalar_first=True), [1.0, 0, 0, 0])
    return AnchorPoses(
        quats_wxyz=torch.as_tensor(quats).float(), translations=torch.as_tensor(moved).float()
    )


def flips_of_the_arm(anchors, poses) -> list[tuple]:
    limbs = find_limbs(anchors, CONFIG.lengths)
    end = int(anchors.positions[:, 0].argmax())
    flips = flipped_poses(anchors, poses, CAMERA, limbs, CONFIG)
    return [(limb, flipped) for limb, flipped in flips if limb.shares[end] == 1]


def places(anchors, poses) -> np.ndarray:
    return (anchors.positions + poses.translations).numpy()


@pytest.mark.parametrize("degrees", [-50, 30, 50])
def test_mirrors_depth_and_keeps_the_picture_and_the_shape(anchors, degrees):
    poses = leaning(anchors, degrees)
    before = places(anchors, poses)
    flips = flips_of_the_arm(anchors, poses)
    assert flips
    limb, flipped = flips[-1]
    after = places(anchors, flipped)
    whole = limb.shares == 1
    base = before[limb.base].mean(axis=0)
    was, now = (np.average(x, axis=0, weights=limb.shares) - base for x in (before, after))
    np.testing.assert_allclose(now, was * [1, 1, -1], atol=0.05)
    np.testing.assert_allclose(after[limb.shares == 0], before[limb.shares == 0], atol=1e-6)
    np.testing.assert_allclose(
        *(torch.pdist(torch.as_tensor(x[whole])).numpy() for x in (after, before)), atol=1e-5
    )
    # The rotations go along: they carry the rest pose of a limb to where it is.
    turns = Rotation.from_quat(flipped.quats_wxyz.numpy()[whole], scalar_first=True)
    arms = anchors.positions.numpy()[whole]
    np.testing.assert_allclose(
        turns[0].apply(arms - arms[0]), after[whole] - after[whole][0], atol=1e-4
    )


def test_what_lies_across_the_view_has_no_other_pose(anchors):
    assert not flips_of_the_arm(anchors, leaning(anchors, 0))


def test_flipped_twice_it_is_back(anchors):
    poses = leaning(anchors, 40)
    limb, once = flips_of_the_arm(anchors, poses)[-1]
    _, twice = flips_of_the_arm(anchors, once)[-1]
    middles = [
        np.average(places(anchors, pose), axis=0, weights=limb.shares) for pose in (poses, twice)
    ]
    np.testing.assert_allclose(*middles, atol=0.1)
