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
    shading.light.copy_(LIGHT)
    posed = turned(sphere, Rotation.from_euler("xy", [30, 40], degrees=True))
    shading.look(posed, CAMERA)
    gains = shading.gains(posed)
    assert gains is not None
    # The normals of a unit sphere are its points; what faces the camera is lit from outside.
    to_camera = torch.as_tensor(CAMERA.position, dtype=torch.float32) - posed.means
    faces = (posed.means * to_camera).sum(dim=1) > 0.3
    expected = ((posed.means - sphere.means) @ LIGHT).exp()
    torch.testing.assert_close(gains[faces, 0], expected[faces], rtol=0.03, atol=0.0)


def test_without_a_light_nothing_is_said(sphere):
    assert Shading(sphere).gains(sphere) is None


def test_at_rest_and_shifted_nothing_changes(sphere):
    shading = Shading(sphere)
    shading.light.copy_(LIGHT)
    shifted = sphere.posed(sphere.means + 5.0, sphere.quats_wxyz)
    shading.look(shifted, CAMERA)
    gains = shading.gains(shifted)
    assert gains is not None
    torch.testing.assert_close(gains, torch.ones_like(gains))


def test_brightness_has_a_slope_in_the_rotation(sphere):
    shading = Shading(sphere)
    shading.light.copy_(LIGHT)
    shading.look(sphere, CAMERA)
    quats = sphere.quats_wxyz.clone().requires_grad_()
    gains = shading.gains(sphere.posed(sphere.means, quats))
    assert gains is not None
    gains.sum().backward()
    assert quats.grad is not None
    assert float(quats.grad.abs().max()) > 0.01
