import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from animator.rigid.growing import GrowingConfig, carry_groups, grow_groups
from animator.types import GaussianMatches, RigidGroups
from tests.helpers.objects import box_points, front_camera

CAMERA = front_camera(size_px=400)


def find_inliers(points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """PnP-RANSAC, written here again so that the region growing is tested by itself."""
    inliers = np.zeros(len(points), bool)
    if len(points) < 6:
        return inliers
    cv2.setRNGSeed(0)
    found, _, _, ids = cv2.solvePnPRansac(
        points, pixels, CAMERA.intrinsics, None, reprojectionError=2.0, flags=cv2.SOLVEPNP_EPNP
    )
    if found and ids is not None:
        inliers[ids[:, 0]] = True
    return inliers


def hinged_bar(angle_deg: float) -> tuple[np.ndarray, GaussianMatches]:
    points = box_points((0, 0, 0), (1.6, 0.4, 0.4), 700, 0)
    turn = Rotation.from_euler("z", angle_deg, degrees=True).as_matrix()
    moved = np.where(points[:, :1] > 0, points @ turn.T, points)
    pixels, _ = CAMERA.project(moved)
    matches = GaussianMatches(
        gaussian_ids=np.arange(len(points)), target_px=pixels, confidences=np.ones(len(points))
    )
    return points, matches


def grow(points: np.ndarray, matches: GaussianMatches, groups: RigidGroups, seed: int = 0):
    return grow_groups(
        groups,
        matches,
        points,
        1.7,
        find_inliers,
        GrowingConfig(radius=0.1),
        np.random.default_rng(seed),
    )


def none(points: np.ndarray) -> RigidGroups:
    return RigidGroups(labels=np.full(len(points), -1))


def test_a_hinge_gives_one_group_on_each_side():
    points, matches = hinged_bar(40)
    groups = grow(points, matches, none(points))
    left = groups.labels[points[:, 0] < -0.15]
    right = groups.labels[points[:, 0] > 0.15]
    dominant = [np.bincount(side[side >= 0]).argmax() for side in (left, right)]
    assert dominant[0] != dominant[1]
    assert np.mean(left == dominant[0]) > 0.9
    assert np.mean(right == dominant[1]) > 0.9


def test_a_rigid_body_is_one_group():
    points, matches = hinged_bar(0)
    groups = grow(points, matches, none(points))
    assert groups.count == 1
    assert np.mean(groups.labels == 0) > 0.95


def test_noise_gives_no_group():
    points, matches = hinged_bar(0)
    rng = np.random.default_rng(1)
    noise = GaussianMatches(
        gaussian_ids=matches.gaussian_ids,
        target_px=rng.uniform(0, 400, matches.target_px.shape),
        confidences=matches.confidences,
    )
    assert grow(points, noise, none(points)).count == 0


def test_carried_groups_stay_break_or_lose_members():
    points, matches = hinged_bar(40)
    left = points[:, 0] < -0.05
    whole = RigidGroups(labels=np.zeros(len(points), int))
    assert carry_groups(whole, matches, points, find_inliers, GrowingConfig()).count == 0
    kept = carry_groups(
        RigidGroups(labels=np.where(left, 0, -1)), matches, points, find_inliers, GrowingConfig()
    )
    assert np.mean(kept.labels[left] == 0) > 0.95
    stray = left | (points[:, 0] > 0.75)
    trimmed = carry_groups(
        RigidGroups(labels=np.where(stray, 0, -1)), matches, points, find_inliers, GrowingConfig()
    )
    assert np.all(trimmed.labels[points[:, 0] > 0.75] == -1)


def test_same_seed_same_groups():
    points, matches = hinged_bar(40)
    first, second = (grow(points, matches, none(points), seed=4) for _ in range(2))
    np.testing.assert_array_equal(first.labels, second.labels)


def test_growing_keeps_the_groups_there_are():
    points, matches = hinged_bar(40)
    left = points[:, 0] < -0.1
    groups = grow(points, matches, RigidGroups(labels=np.where(left, 0, -1)))
    assert np.all(groups.labels[left] == 0)
    assert groups.count >= 2
