import numpy as np
import torch
from scipy.spatial.transform import Rotation

from animator.sequence.pose_change import carried, extrapolated, step_length
from animator.types import AnchorPoses


def pose(degrees: float, shift: float, *, sign: float = 1.0) -> AnchorPoses:
    quat = sign * Rotation.from_euler("xyz", [0, degrees, 0], degrees=True).as_quat(
        scalar_first=True
    )
    return AnchorPoses(
        quats_wxyz=torch.tensor(np.tile(quat, (3, 1)), dtype=torch.float32),
        translations=torch.full((3, 3), shift),
    )


def assert_same(found: AnchorPoses, expected: AnchorPoses) -> None:
    torch.testing.assert_close(found.translations, expected.translations)
    cosines = (found.quats_wxyz * expected.quats_wxyz).sum(dim=1).abs()
    torch.testing.assert_close(cosines, torch.ones(3))


def test_motion_goes_on_as_it_was():
    assert_same(extrapolated(pose(10, 0.1), pose(35, 0.3)), pose(60, 0.5))


def test_the_sign_of_a_quaternion_means_nothing():
    assert_same(extrapolated(pose(10, 0.0), pose(35, 0.0, sign=-1.0)), pose(60, 0.0))


def test_what_rests_stays():
    assert_same(extrapolated(pose(20, 0.2), pose(20, 0.2)), pose(20, 0.2))


def test_a_change_is_done_to_another_pose():
    assert_same(carried(pose(10, 0.1), pose(35, 0.3), pose(50, 0.0)), pose(75, 0.2))


def test_no_change_leaves_a_pose_as_it_is():
    assert_same(carried(pose(10, 0.1), pose(10, 0.1, sign=-1.0), pose(50, 0.0)), pose(50, 0.0))


def test_a_step_is_that_of_what_moves_fast_and_not_of_a_single_anchor():
    quats_wxyz = torch.tensor([[1.0, 0.0, 0.0, 0.0]]).repeat(41, 1)
    shifts = torch.zeros(41, 3)
    still = AnchorPoses(quats_wxyz=quats_wxyz, translations=shifts)
    shifts = shifts.clone()
    shifts[:4, 0] = torch.tensor([9.0, 0.5, 0.5, 0.5])
    assert step_length(still, AnchorPoses(quats_wxyz=quats_wxyz, translations=shifts)) == 0.5
