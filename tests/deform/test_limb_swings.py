import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.limb_swings import SwingConfig, swung_poses
from animator.deform.limbs import find_limbs
from animator.types import AnchorPoses
from tests.helpers.objects import box_points, front_camera, gaussians_at

CAMERA = front_camera(30.0)
"""So far away that all its rays are alike."""


def armed(direction: tuple[float, float, float]):
    """Anchors of a body with an arm in some direction, and the arm."""
    body = box_points((0, 0, 0), (0.8, 0.8, 0.8), 1500, 0)
    arm = box_points((0.9, 0, 0), (1.0, 0.2, 0.2), 400, 1)
    turn, _ = Rotation.align_vectors([direction], [(1.0, 0.0, 0.0)])
    points = turn.apply(np.concatenate([body, arm]))
    anchors = build_anchors(gaussians_at(points), target_count=60)
    end = int((anchors.positions.numpy() @ np.array(direction)).argmax())
    (limb,) = (limb for limb in find_limbs(anchors, (0.5,)) if limb.tip == end)
    return anchors, limb


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.6, -0.8), (0.0, 0.0, -1.0)])
def test_swings_by_the_angle_to_sides_evenly_spread(direction):
    anchors, limb = armed(direction)
    rest = AnchorPoses.identity(anchors)
    config = SwingConfig(angle_deg=30.0, sides=4)
    swung = list(swung_poses(anchors, rest, CAMERA, limb, config))
    assert len(swung) == 4
    whole = limb.shares == 1
    axes = []
    for poses in swung:
        turns = Rotation.from_quat(poses.quats_wxyz.numpy()[whole], scalar_first=True).as_rotvec()
        np.testing.assert_allclose(turns, np.tile(turns[0], (whole.sum(), 1)), atol=1e-6)
        np.testing.assert_allclose(np.degrees(np.linalg.norm(turns[0])), 30.0, atol=1e-3)
        assert (poses.translations.numpy()[limb.shares == 0] == 0).all()
        axes.append(turns[0])
    np.testing.assert_allclose(axes[2], -axes[0], atol=1e-6)
    np.testing.assert_allclose(axes[3], -axes[1], atol=1e-6)
    assert axes[0] @ axes[1] == pytest.approx(0.0, abs=1e-6)


def test_swings_away_from_the_camera_first():
    anchors, limb = armed((1.0, 0.0, 0.0))
    rest = AnchorPoses.identity(anchors)
    first = next(swung_poses(anchors, rest, CAMERA, limb, SwingConfig()))
    assert float(first.translations[limb.tip, 2]) > 0.2
