import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.shading import Shading
from animator.types import Gaussians
from tests.helpers.objects import front_camera, gaussians_at

LIGHT = torch.tensor([0.1, 0.2, 0.3])
CAMERA = front_camera()


@pytest.fixture(scope="module")
def sphere() -> Gaussians:
    points = np.random.default_rng(0).standard_normal((4000, 3))
    sphere = gaussians_at(points / np.linalg.norm(points, axis=1, keepdims=True))
    quats = torch.nn.functional.normalize(torch.randn(4000, 4, generator=torch.manual_seed(0)))
    return sphere.posed(sphere.means, quats)


def turned(gaussians: Gaussians, turn: Rotation) -> Gaussians:
    own = Rotation.from_quat(gaussians.quats_wxyz.numpy(), scalar_first=True)
    return gaussians.posed(
        torch.as_tensor(turn.apply(gaussians.means.numpy()), dtype=torch.float32),
        torch.as_tensor((turn * own).as_quat(scalar_first=True), dtype=torch.float32),
    )


def test_colors_change_with_the_outer_normal(sphere):
    shading = Shading(sphere)
    shading.light = LIGHT
    posed = turned(sphere, Rotation.from_euler("xy", [30, 40], degrees=True))
    shading.look(posed, CAMERA)
    log_gains = shading.log_gains(posed)
    assert log_gains is not None
    # The normals of a unit sphere are its points; what faces the camera is lit from outside.
    to_camera = torch.as_tensor(CAMERA.position, dtype=torch.float32) - posed.means
    faces = (posed.means * to_camera).sum(dim=1) > 0.3
    expected = (posed.means - sphere.means) @ LIGHT
    torch.testing.assert_close(log_gains[faces], expected[faces], rtol=0.0, atol=0.03)


def test_without_a_light_nothing_is_said(sphere):
    assert Shading(sphere).log_gains(sphere) is None


def test_what_has_no_surface_keeps_its_color():
    lump = gaussians_at(np.random.default_rng(0).standard_normal((300, 3)))
    shading = Shading(lump)
    shading.light = LIGHT
    posed = turned(lump, Rotation.from_euler("y", 60, degrees=True))
    shading.look(posed, CAMERA)
    log_gains = shading.log_gains(posed)
    assert log_gains is not None
    assert float(shading.normal_changes(posed).norm(dim=1).median()) > 0.5
    assert float(log_gains.abs().median()) == 0.0


def test_at_rest_and_shifted_nothing_changes(sphere):
    shading = Shading(sphere)
    shading.light = LIGHT
    shifted = sphere.posed(sphere.means + 5.0, sphere.quats_wxyz)
    shading.look(shifted, CAMERA)
    log_gains = shading.log_gains(shifted)
    assert log_gains is not None
    torch.testing.assert_close(log_gains, torch.zeros_like(log_gains))


def test_brightness_has_a_slope_in_the_rotation(sphere):
    shading = Shading(sphere)
    shading.light = LIGHT
    shading.look(sphere, CAMERA)
    quats = sphere.quats_wxyz.clone().requires_grad_()
    log_gains = shading.log_gains(sphere.posed(sphere.means, quats))
    assert log_gains is not None
    log_gains.sum().backward()
    assert quats.grad is not None
    assert float(quats.grad.abs().max()) > 0.01
