"""Colors follow the pose in the light of the clip, or stay as they were seen."""

import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.shading import Shading
from animator.sequence.view_colors import ViewColors
from animator.types import Gaussians
from tests.helpers.objects import front_camera
from tests.helpers.textured import textured_box

CAMERA = front_camera()


@pytest.fixture(scope="module")
def box() -> Gaussians:
    return textured_box(1500)


def turned(box: Gaussians, degrees: float) -> Gaussians:
    quat = Rotation.from_euler("y", degrees, degrees=True).as_quat(scalar_first=True)
    return box.posed(box.means, torch.tensor(quat, dtype=torch.float32).expand(len(box), 4))


def lit_colors(box: Gaussians) -> ViewColors:
    shading = Shading(box)
    shading.light = torch.tensor([0.3, 0.0, -0.2])
    return ViewColors(shading)


def test_colors_follow_the_pose_or_stay_as_seen(box):
    colors = lit_colors(box)
    seen, other = turned(box, 40), turned(box, 60)
    colors.look(seen, CAMERA)
    as_seen = colors.paint(seen).sh_coeffs
    torch.testing.assert_close(colors.paint_as_seen(box).sh_coeffs, as_seen)
    torch.testing.assert_close(colors.paint_as_seen(other).sh_coeffs, as_seen)
    assert float((colors.paint(other).sh_coeffs - as_seen).abs().max()) > 0.02


def test_at_rest_and_without_a_light_colors_are_those_captured(box):
    colors = lit_colors(box)
    colors.look(box, CAMERA)
    torch.testing.assert_close(colors.paint(box).sh_coeffs, box.sh_coeffs)
    unlit = ViewColors(Shading(box))
    unlit.look(turned(box, 40), CAMERA)
    assert unlit.paint(turned(box, 40)).sh_coeffs is box.sh_coeffs


def test_before_the_first_look_nothing_is_seen(box):
    assert ViewColors().paint_as_seen(box) is box
