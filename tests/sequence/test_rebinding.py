"""What a coarse rig has solved, on a finer one."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.sequence.rebinding import rebound
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.types import AnchorPoses, AnchorUncertainty, RigidGroups
from tests.helpers.objects import front_camera
from tests.helpers.textured import fold, textured_box


@pytest.fixture(scope="module")
def rigs():
    box = textured_box(1500)
    return box, build_anchors(box, target_count=60), build_anchors(box, target_count=150)


def frame_of(poses: AnchorPoses, uncertainty: AnchorUncertainty | None = None) -> SolvedFrame:
    stats = FrameStats(matches=0, reprojection_px=0.0, start="previous", groups=0, seconds={})
    groups = RigidGroups(labels=np.zeros(0, np.int64))
    return SolvedFrame(
        poses=poses, camera=front_camera(3.0), groups=groups, stats=stats, uncertainty=uncertainty
    )


def test_rest_stays_exactly_at_rest(rigs):
    box, coarse, fine = rigs
    (frame,) = rebound([frame_of(AnchorPoses.identity(coarse))], box, coarse, fine)
    assert frame.poses.translations.count_nonzero() == 0
    torch.testing.assert_close(frame.poses.quats_wxyz, AnchorPoses.identity(fine).quats_wxyz)
    assert frame.uncertainty is None


def test_one_body_moves_on_as_one(rigs):
    box, coarse, fine = rigs
    turn = Rotation.from_rotvec([0.3, -1.2, 2.0])

    def moved(anchors):
        places = anchors.positions.numpy()
        shifts = turn.apply(places) + np.array([0.1, 0.2, -0.3]) - places
        quats = np.tile(turn.as_quat(scalar_first=True), (len(places), 1))
        return AnchorPoses(
            quats_wxyz=torch.from_numpy(quats).float(),
            translations=torch.from_numpy(shifts).float(),
        )

    (frame,) = rebound([frame_of(moved(coarse))], box, coarse, fine)
    expected = moved(fine)
    torch.testing.assert_close(frame.poses.translations, expected.translations)
    cosines = (frame.poses.quats_wxyz * expected.quats_wxyz).sum(dim=1).abs()
    torch.testing.assert_close(cosines, torch.ones_like(cosines))


def test_a_fold_is_followed_on_both_sides(rigs):
    box, coarse, fine = rigs
    places, quats_wxyz = fold(coarse.positions, 50.0)
    folded = AnchorPoses(quats_wxyz=quats_wxyz, translations=places - coarse.positions)
    (frame,) = rebound([frame_of(folded)], box, coarse, fine)
    expected = fold(fine.positions, 50.0)[0]
    errors = (fine.positions + frame.poses.translations - expected).norm(dim=1)
    assert float(errors.median()) < 1e-3
    assert float(errors.max()) < coarse.spacing


def test_each_anchor_is_as_uncertain_as_what_carried_it(rigs):
    box, coarse, fine = rigs
    right = coarse.positions[:, 0].numpy() > 0
    sigmas = np.where(right, 2.0, 1.0).astype(np.float32)
    known = AnchorUncertainty(along_ray=3.0 * sigmas, across_ray=sigmas)
    (frame,) = rebound([frame_of(AnchorPoses.identity(coarse), known)], box, coarse, fine)
    assert frame.uncertainty is not None
    across, x = frame.uncertainty.across_ray, fine.positions[:, 0].numpy()
    np.testing.assert_allclose(frame.uncertainty.along_ray, 3.0 * across, rtol=1e-5)
    np.testing.assert_allclose(across[x > 2 * coarse.spacing], 2.0, rtol=1e-2)
    np.testing.assert_allclose(across[x < -2 * coarse.spacing], 1.0, rtol=1e-2)
    assert across.dtype == np.float32
