"""The CPU renderer against a dense float64 one: image, every gradient, depth, visibility."""

import dataclasses
import logging

import numpy as np
import pytest
import torch
from dense_reference import DenseRendering, render_dense
from splat_scenes import FIELDS, camera, gaussians

from animator.errors import InputError
from animator.render.cpu import CpuRenderer
from animator.types import Camera, Gaussians

RENDERER = CpuRenderer()


def _leaves(scene: Gaussians, dtype: torch.dtype) -> dict[str, torch.Tensor]:
    return {
        name: getattr(scene, name).detach().to(dtype).clone().requires_grad_() for name in FIELDS
    }


def _with(scene: Gaussians, **changes) -> Gaussians:
    return dataclasses.replace(scene, **changes)


def _behind() -> Gaussians:
    scene = gaussians(1, 60)
    scene.means[::3] *= 8
    return scene


def _tiny() -> Gaussians:
    scene = gaussians(2, 60)
    return _with(scene, scales=scene.scales * 1e-5)


def _huge() -> Gaussians:
    scene = gaussians(3, 25)
    return _with(scene, scales=scene.scales * 30, opacities=scene.opacities * 0.3)


def _opaque() -> Gaussians:
    scene = gaussians(4, 60)
    return _with(scene, opacities=torch.linspace(0.97, 1.0, 60))


def _faint() -> Gaussians:
    scene = gaussians(5, 60)
    return _with(scene, opacities=torch.linspace(0.001, 0.02, 60))


def _needles() -> Gaussians:
    scene = gaussians(6, 50)
    return _with(scene, scales=scene.scales * torch.tensor([12.0, 0.05, 0.001]))


CASES = {
    "overlapping": (gaussians(0, 150), camera(41, 29)),
    "one tile exactly": (gaussians(7, 40), camera(16, 16)),
    "tall": (gaussians(8, 60), camera(21, 50)),
    "single pixel": (gaussians(9, 40), camera(1, 1)),
    "behind the camera and beside the image": (_behind(), camera(40, 33)),
    "zoomed in": (gaussians(10, 60), camera(40, 33, distance=1.0, zoom=4.0)),
    "tiny": (_tiny(), camera(40, 33)),
    "huge": (_huge(), camera(40, 33)),
    "opaque": (_opaque(), camera(40, 33)),
    "faint": (_faint(), camera(40, 33)),
    "needles": (_needles(), camera(50, 33)),
    "one Gaussian": (gaussians(11, 1), camera(33, 20)),
    "degree 1": (gaussians(12, 30, degree=1), camera(30, 20)),
    "degree 2": (gaussians(13, 30, degree=2), camera(30, 20)),
    "degree 3": (gaussians(14, 30, degree=3), camera(30, 20)),
}


@pytest.fixture(scope="module", params=CASES, ids=lambda name: name.replace(" ", "-"))
def case(request) -> tuple[Gaussians, Camera, dict[str, torch.Tensor], DenseRendering]:
    scene, view = CASES[request.param]
    fields = _leaves(scene, torch.float64)
    return scene, view, fields, render_dense(fields, view)


def test_image_and_gradients_equal_the_dense_renderer(case):
    scene, view, dense_fields, dense = case
    fields = _leaves(scene, torch.float32)
    drawn = RENDERER.render(Gaussians(**fields), view)
    sure = ~dense.is_ambiguous
    assert sure.double().mean() > 0.5
    # The exponent of a needle is a difference of large squares, in gsplat as well.
    is_needle = float(scene.scales.amin()) < 1e-4 < float(scene.scales.amax()) / 1000
    slack, gradient_slack = (1e-4, 2e-3) if is_needle else (5e-6, 5e-5)
    torch.testing.assert_close(drawn.rgb[sure].double(), dense.rgb[sure], rtol=0, atol=slack)
    torch.testing.assert_close(drawn.alpha[sure].double(), dense.alpha[sure], rtol=0, atol=slack)

    rng = np.random.default_rng(99)
    weight_rgb = torch.from_numpy(rng.normal(size=drawn.rgb.shape)) * sure[:, :, None]
    weight_alpha = torch.from_numpy(rng.normal(size=drawn.alpha.shape)) * sure
    ((drawn.rgb * weight_rgb.float()).sum() + (drawn.alpha * weight_alpha.float()).sum()).backward()
    ((dense.rgb * weight_rgb).sum() + (dense.alpha * weight_alpha).sum()).backward()
    for name in FIELDS:
        found, expected = fields[name].grad, dense_fields[name].grad
        assert found is not None
        if expected is None:
            expected = torch.zeros_like(dense_fields[name])
        error = (found.double() - expected).norm() / expected.norm().clamp_min(1e-9)
        assert error < gradient_slack, f"{name}: relative error {float(error):.2e}"


def test_depth_is_the_alpha_weighted_mean(case):
    scene, view, _fields, dense = case
    depth = RENDERER.depth(scene, view)
    sure = ~dense.is_ambiguous
    expected = torch.where(dense.alpha > 0, dense.depth_sum / dense.alpha, 0.0).detach()
    torch.testing.assert_close(depth[sure].double(), expected[sure], rtol=1e-4, atol=1e-5)


def test_visibility_compares_with_the_gaussian_drawn_alone(case):
    scene, view, _fields, dense = case
    seen = RENDERER.visibility(scene, view)
    slack = 2e-4 + float(dense.is_ambiguous.sum()) / 255  # a pixel at the threshold, either way
    np.testing.assert_allclose(seen.contributions, dense.contributions, rtol=1e-4, atol=slack)
    is_large = (dense.unoccluded > 100 * slack).numpy()
    shares = (dense.contributions / dense.unoccluded.clamp_min(1e-9)).numpy()
    np.testing.assert_allclose(seen.visible_shares[is_large], shares[is_large], atol=0.02)
    np.testing.assert_array_equal(seen.visible_shares[seen.contributions == 0], 0)
    centres, depths = view.project(scene.means.double().numpy())
    np.testing.assert_allclose(seen.centres_px, centres, rtol=1e-6)
    np.testing.assert_allclose(seen.depths, depths, rtol=1e-6)


def test_positions_and_rotations_alone_get_the_same_gradients():
    scene, view = CASES["overlapping"]
    everything = _leaves(scene, torch.float32)
    moving = {
        name: value if name in ("means", "quats_wxyz") else value.detach()
        for name, value in _leaves(scene, torch.float32).items()
    }
    for fields in (everything, moving):
        RENDERER.render(Gaussians(**fields), view).rgb.square().sum().backward()
    for name in ("means", "quats_wxyz"):
        torch.testing.assert_close(moving[name].grad, everything[name].grad, rtol=1e-5, atol=1e-6)
    assert moving["scales"].grad is None and moving["sh_coeffs"].grad is None


def test_two_renderings_before_their_backward_passes_do_not_disturb_each_other():
    scene, view = CASES["overlapping"]
    fields = _leaves(scene, torch.float32)
    other = _with(scene, means=scene.means + 0.3)
    first = RENDERER.render(Gaussians(**fields), view)
    second = RENDERER.render(_with(other, means=other.means.clone().requires_grad_()), view)
    (second.rgb.sum() + second.alpha.sum()).backward()
    (first.rgb.sum() + first.alpha.sum()).backward()
    together = {name: value.grad.clone() for name, value in fields.items()}
    alone = _leaves(scene, torch.float32)
    rendering = RENDERER.render(Gaussians(**alone), view)
    (rendering.rgb.sum() + rendering.alpha.sum()).backward()
    for name in FIELDS:
        assert torch.equal(together[name], alone[name].grad)


def test_no_gaussians_give_the_background():
    empty = Gaussians(
        **{name: value[:0] for name, value in _leaves(gaussians(0, 1), torch.float32).items()}
    )
    rendering = RENDERER.render(empty, camera(20, 10), background=(0.2, 0.4, 0.6))
    torch.testing.assert_close(rendering.rgb, torch.tensor([0.2, 0.4, 0.6]).expand(10, 20, 3))
    assert not rendering.alpha.any()
    assert not RENDERER.depth(empty, camera(20, 10)).any()
    assert RENDERER.visibility(empty, camera(20, 10)).visible_shares.shape == (0,)


@pytest.mark.parametrize("field", ["means", "quats_wxyz", "scales", "opacities", "sh_coeffs"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_broken_gaussians_are_skipped_and_counted_once(field, value, caplog):
    scene, view = gaussians(0, 30), camera(30, 20)
    rest = {name: getattr(scene, name)[:20] for name in FIELDS}
    broken = {name: getattr(scene, name).clone() for name in FIELDS}
    broken[field][20:] = value
    leaves = {name: tensor.requires_grad_() for name, tensor in broken.items()}
    renderer = CpuRenderer()
    with caplog.at_level(logging.WARNING):
        rendering = renderer.render(Gaussians(**leaves), view)
        renderer.render(Gaussians(**leaves), view)
    assert [record.message[:16] for record in caplog.records] == ["10 of 30 Gaussia"]
    assert torch.equal(rendering.rgb, renderer.render(Gaussians(**rest), view).rgb)
    (rendering.rgb.sum() + rendering.alpha.sum()).backward()
    for name, leaf in leaves.items():
        assert torch.isfinite(leaf.grad).all(), name
        assert not leaf.grad[20:].any(), name


def test_a_zero_quaternion_is_broken():
    scene, view = gaussians(0, 3), camera(30, 20)
    scene.quats_wxyz[0] = 0
    assert torch.isfinite(RENDERER.render(scene, view).rgb).all()


def test_frozen_degree_0_colors_follow_their_tensor():
    scene, view = gaussians(0, 30), camera(30, 20)
    before = RENDERER.render(scene, view).rgb
    scene.sh_coeffs.add_(0.5)
    brighter = RENDERER.render(scene, view).rgb
    assert (brighter.sum() - before.sum()) > 1
    assert torch.equal(
        RENDERER.render(_with(scene, sh_coeffs=scene.sh_coeffs - 0.5), view).rgb.round(decimals=4),
        before.round(decimals=4),
    )


def test_more_tile_entries_than_expected_only_cost_time():
    # 40 Gaussians that cover every tile: the first guess of four slots each is far too low.
    scene = _with(
        gaussians(3, 40), scales=torch.full((40, 3), 3.0), opacities=torch.full((40,), 0.1)
    )
    view = camera(200, 130)
    alpha = CpuRenderer().render(scene, view).alpha
    assert float(alpha.min()) > 0.9


def test_skew_and_empty_images_are_refused():
    view = camera(20, 10)
    intrinsics = view.intrinsics.copy()
    intrinsics[0, 1] = 1.5
    skewed = dataclasses.replace(view, intrinsics=intrinsics)
    with pytest.raises(InputError, match=r"skew, found 1\.5"):
        RENDERER.render(gaussians(0, 3), skewed)
    with pytest.raises(InputError, match="0 x 10"):
        RENDERER.render(gaussians(0, 3), dataclasses.replace(view, width_px=0))
