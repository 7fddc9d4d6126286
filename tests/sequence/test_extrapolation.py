import numpy as np
import torch
from scipy.spatial.transform import Rotation

from animator.sequence.extrapolation import extrapolated
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
