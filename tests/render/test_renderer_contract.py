"""What every renderer must do, whatever it is made of."""

import dataclasses

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from splat_scenes import FIELDS, camera, gaussians

from animator.render.registry import RENDERERS, load_renderer
from animator.types import Camera, Gaussians

SETTINGS = settings(derandomize=True, max_examples=8, deadline=None)


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(device, marks=pytest.mark.gpu if device == "cuda" else ())
        for device in RENDERERS
    ],
)
def renderer(request):
    return load_renderer(request.param)


def _moved_to(scene: Gaussians, renderer) -> Gaussians:
    return Gaussians(**{name: getattr(scene, name).to(renderer.device) for name in FIELDS})


def _image(renderer, scene: Gaussians, view: Camera, **options) -> torch.Tensor:
    drawn = renderer.render(_moved_to(scene, renderer), view, **options)
    return torch.cat([drawn.rgb, drawn.alpha[:, :, None]], 2).detach().cpu()


def _share_different(left: torch.Tensor, right: torch.Tensor) -> float:
    """Return the share of pixels that differ by more than rounding: thresholds may flip a few."""
    return float(((left - right).abs().amax(2) > 1e-4).double().mean())


@SETTINGS
@given(seed=st.integers(0, 10**6), degree=st.integers(0, 3))
def test_scene_and_camera_moved_together_change_nothing(renderer, seed, degree):
    # The harmonics are tied to the world axes, so a rotated world needs a degree-0 color.
    rng = np.random.default_rng(seed)
    scene, view = gaussians(seed, 40, degree=degree), camera(37, 26)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.linalg.det(rotation)
    if degree > 0:
        rotation = np.eye(3)
    shift = rng.normal(size=3)
    world_from_old = np.eye(4)
    world_from_old[:3, :3], world_from_old[:3, 3] = rotation, shift
    turn = torch.from_numpy(_quaternion(rotation)).float()
    moved = dataclasses.replace(
        scene,
        means=(
            scene.means.double() @ torch.from_numpy(rotation.T) + torch.from_numpy(shift)
        ).float(),
        quats_wxyz=_product(turn, scene.quats_wxyz),
    )
    moved_view = view.with_pose(view.cam_from_world @ np.linalg.inv(world_from_old))
    assert (
        _share_different(_image(renderer, scene, view), _image(renderer, moved, moved_view)) < 0.01
    )


@SETTINGS
@given(seed=st.integers(0, 10**6), count=st.integers(2, 80))
def test_order_of_the_gaussians_does_not_matter(renderer, seed, count):
    scene, view = gaussians(seed, count), camera(37, 26)
    order = torch.from_numpy(np.random.default_rng(seed).permutation(count))
    shuffled = Gaussians(**{name: getattr(scene, name)[order] for name in FIELDS})
    assert torch.equal(_image(renderer, scene, view), _image(renderer, shuffled, view))
    seen = renderer.visibility(_moved_to(scene, renderer), view)
    seen_shuffled = renderer.visibility(_moved_to(shuffled, renderer), view)
    np.testing.assert_allclose(seen.contributions[order], seen_shuffled.contributions, rtol=1e-5)


def test_zero_opacity_gives_the_background(renderer):
    scene = dataclasses.replace(gaussians(0, 30), opacities=torch.zeros(30))
    image = _image(renderer, scene, camera(20, 30), background=(0.1, 0.5, 0.9))
    assert torch.equal(image, torch.tensor([0.1, 0.5, 0.9, 0.0]).expand(30, 20, 4))


def test_background_shines_through_by_one_minus_alpha(renderer):
    scene, view = gaussians(0, 30), camera(20, 30)
    black, tinted = (
        _image(renderer, scene, view, background=b) for b in ((0, 0, 0), (0.2, 0.4, 1))
    )
    expected = (1 - black[:, :, 3:]) * torch.tensor([0.2, 0.4, 1.0])
    torch.testing.assert_close(tinted[:, :, :3] - black[:, :, :3], expected, rtol=0, atol=1e-6)


def test_one_gaussian_in_front_has_its_own_color_alpha_and_depth(renderer):
    # On the optical axis, 4 in front; sigma 0.5 * 40 / 4 = 5 px: the four central pixels are
    # (0.5, 0.5) px off, so alpha = 0.8 exp(-0.5 * 0.5 / (25 + 0.3)).
    scene = Gaussians(
        means=torch.tensor([[0.0, 0, 4]]),
        quats_wxyz=torch.tensor([[1.0, 0, 0, 0]]),
        scales=torch.full((1, 3), 0.5),
        opacities=torch.tensor([0.8]),
        sh_coeffs=(torch.tensor([[[1.0, 0.25, 0.0]]]) - 0.5) / 0.28209479177387814,
    )
    intrinsics = np.array([[40.0, 0, 10], [0, 40, 8], [0, 0, 1]])
    view = Camera(cam_from_world=np.eye(4), intrinsics=intrinsics, width_px=20, height_px=16)
    alpha = 0.8 * np.exp(-0.25 / 25.3)
    image = _image(renderer, scene, view)
    expected = torch.tensor([alpha, 0.25 * alpha, 0, alpha]).float().expand(2, 2, 4)
    torch.testing.assert_close(image[7:9, 9:11], expected, rtol=1e-5, atol=1e-6)
    depth = renderer.depth(_moved_to(scene, renderer), view).cpu()
    torch.testing.assert_close(depth[7:9, 9:11], torch.full((2, 2), 4.0))


def test_visibility_tells_front_from_back(renderer):
    # Two equal discs on one axis, the front one almost opaque; a third to the side, free.
    scene = Gaussians(
        means=torch.tensor([[0.0, 0, 4], [0.0, 0, 6], [-1.0, 0, 4]]),
        quats_wxyz=torch.tensor([[1.0, 0, 0, 0]]).repeat(3, 1),
        scales=torch.tensor([[0.2] * 3, [0.1] * 3, [0.1] * 3]),
        opacities=torch.tensor([0.99, 0.5, 0.5]),
        sh_coeffs=torch.zeros(3, 1, 3),
    )
    intrinsics = np.array([[80.0, 0, 32], [0, 80, 24], [0, 0, 1]])
    view = Camera(cam_from_world=np.eye(4), intrinsics=intrinsics, width_px=64, height_px=48)
    seen = renderer.visibility(_moved_to(scene, renderer), view)
    assert seen.visible_shares[0] > 0.98
    assert seen.visible_shares[1] < 0.15
    assert seen.visible_shares[2] > 0.95
    assert seen.contributions[0] > seen.contributions[2] > seen.contributions[1] > 0


def test_all_five_fields_get_gradients(renderer):
    scene = _moved_to(gaussians(0, 30, degree=1), renderer)
    leaves = {name: getattr(scene, name).clone().requires_grad_() for name in FIELDS}
    renderer.render(Gaussians(**leaves), camera(30, 20)).rgb.square().sum().backward()
    for name, leaf in leaves.items():
        assert leaf.grad is not None and leaf.grad.abs().sum() > 0, name


def _product(left: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
    w, u = left[0], left[1:].expand(len(right), 3)
    scalar = w * right[:, :1] - (u * right[:, 1:]).sum(1, keepdim=True)
    vector = w * right[:, 1:] + right[:, :1] * u + torch.linalg.cross(u, right[:, 1:])
    return torch.cat([scalar, vector], 1)


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_quat()[[3, 0, 1, 2]]
