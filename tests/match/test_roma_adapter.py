"""The RoMa adapter, on a stand-in with the same three methods; the real weights are 1.6 GB."""

import sys
import types

import numpy as np
import pytest
import torch
from textured_pairs import Affine, flow_errors, moved_pair

from animator.errors import InputError
from animator.match.protocol import MaskedImage
from animator.match.registry import MATCHERS, load_matcher
from animator.match.roma import SAMPLE_COUNT, RomaMatcher, load_roma

SHIFT_PX = (7.5, -3.0)
WARP_SIDE = 80


class StandIn:
    """Knows the answer: everything in the crop moves by a share of the crop's size."""

    def __init__(self, *, has_batch_axis: bool = True):
        self._has_batch_axis = has_batch_axis
        self.sizes: list[tuple[int, int]] = []

    def match(self, image_a, image_b, *, device):
        assert image_a.size == image_b.size
        self.sizes.append(image_a.size)
        steps = (torch.arange(WARP_SIDE) + 0.5) / WARP_SIDE * 2 - 1
        ys, xs = torch.meshgrid(steps, steps, indexing="ij")
        own = torch.stack([xs, ys], -1)
        shift = self.shift(image_a.size)
        there = torch.cat([own, own + shift], -1)
        back = torch.cat([own - shift, own], -1)
        warp = torch.cat([there, back], 1)
        certainty = torch.full(warp.shape[:2], 0.8)
        certainty[: WARP_SIDE // 2, :WARP_SIDE] = 0.01
        if self._has_batch_axis:
            return warp[None], certainty[None]
        return warp, certainty

    def sample(self, warp, certainty, *, num):
        assert warp.ndim == 3 and certainty.ndim == 2
        picks = torch.multinomial(certainty.reshape(-1), num, replacement=True)
        return warp.reshape(-1, 4)[picks], certainty.reshape(-1)[picks]

    def to_pixel_coordinates(self, matches, height_a, width_a, height_b, width_b):
        half_a, half_b = (
            torch.tensor([width_a, height_a]) / 2,
            torch.tensor([width_b, height_b]) / 2,
        )
        return (matches[:, :2] + 1) * half_a, (matches[:, 2:] + 1) * half_b

    @staticmethod
    def shift(size):
        # The crop is twice as fine as the image: its object of 160 px is small.
        scale = TEXTURED_SCALE
        return torch.tensor([2 * scale * SHIFT_PX[0] / size[0], 2 * scale * SHIFT_PX[1] / size[1]])


def _pair() -> tuple[MaskedImage, MaskedImage]:
    return moved_pair(Affine(shift_px=SHIFT_PX), seed=4)


def _scale() -> float:
    from animator.match.window import window_around

    window = window_around(*_pair())
    assert window is not None
    return float(window.scale[0])


TEXTURED_SCALE = _scale()


@pytest.mark.parametrize("has_batch_axis", [True, False])
def test_a_warp_becomes_a_flow_in_pixels(has_batch_axis):
    source, target = _pair()
    flow = RomaMatcher(StandIn(has_batch_axis=has_batch_axis)).flow(source, target)
    errors = flow_errors(flow, Affine(shift_px=SHIFT_PX))
    assert flow.matcher == "roma"
    assert errors.max() < 0.1
    # The upper half of the crop is uncertain and must not be trusted.
    rows = np.flatnonzero(flow.confidences.any(axis=1))
    assert 115 < rows.min() < 135
    assert 0.4 < flow.confidences.max() <= 0.8


def test_drawn_matches_are_in_pixels_and_repeatable():
    source, target = _pair()
    torch.manual_seed(5)
    before = torch.random.get_rng_state()
    first = RomaMatcher(StandIn()).match(source, target)
    torch.testing.assert_close(torch.random.get_rng_state(), before)
    torch.manual_seed(6)
    second = RomaMatcher(StandIn()).match(source, target)
    assert 100 < len(first) < SAMPLE_COUNT
    np.testing.assert_allclose(
        first.target_px - first.source_px, np.broadcast_to(SHIFT_PX, (len(first), 2)), atol=0.01
    )
    np.testing.assert_array_equal(first.source_px, second.source_px)


def test_no_object_no_matches():
    source, target = _pair()
    empty = MaskedImage(rgb=target.rgb, mask=np.zeros_like(target.mask))
    assert len(RomaMatcher(StandIn()).match(source, empty)) == 0
    assert not RomaMatcher(StandIn()).flow(empty, target).confidences.any()


def test_without_weights_the_error_says_what_to_bring():
    with pytest.raises(InputError, match=r"--roma-weights.*dinov2_vitl14.*nothing is downloaded"):
        load_matcher("roma")


def test_missing_and_foreign_files_are_named(tmp_path):
    missing, text = tmp_path / "roma_outdoor.pth", tmp_path / "text.pth"
    text.write_text("not weights")
    with pytest.raises(InputError, match=r"roma_outdoor\.pth is not a file"):
        load_roma([missing, text])
    with pytest.raises(InputError, match=r"text\.pth is not a plain PyTorch state dict"):
        load_roma([text, text])
    same = tmp_path / "same.pth"
    torch.save({"decoder.weight": torch.zeros(1)}, same)
    with pytest.raises(InputError, match="got no DINOv2 file"):
        load_roma([same, same])


def test_weights_reach_romatch_in_any_order(tmp_path, monkeypatch):
    roma, dino = tmp_path / "a.pth", tmp_path / "b.pth"
    torch.save({"decoder.weight": torch.zeros(1)}, roma)
    torch.save({"cls_token": torch.ones(1)}, dino)
    calls = []
    package = types.ModuleType("romatch")
    package.roma_outdoor = lambda **options: calls.append(options) or StandIn()
    monkeypatch.setitem(sys.modules, "romatch", package)
    matcher = load_matcher("roma", roma_weights=[str(dino), str(roma)])
    assert isinstance(matcher, RomaMatcher)
    assert set(calls[0]["weights"]) == {"decoder.weight"}
    assert set(calls[0]["dinov2_weights"]) == {"cls_token"}
    assert calls[0]["use_custom_corr"] is False
    assert calls[0]["coarse_res"] % 14 == 0


def test_without_the_package_the_error_says_how_to_install_it(tmp_path, monkeypatch):
    roma, dino = tmp_path / "a.pth", tmp_path / "b.pth"
    torch.save({"decoder.weight": torch.zeros(1)}, roma)
    torch.save({"cls_token": torch.ones(1)}, dino)
    monkeypatch.setitem(sys.modules, "romatch", None)
    with pytest.raises(InputError, match=r"pip install splatimate\[roma\]"):
        load_roma([roma, dino])


def test_matchers_are_made_by_name():
    assert set(MATCHERS) == {"auto", "flow", "xfeat", "roma"}
    assert type(load_matcher("flow")).__name__ == "FlowMatcher"
    assert type(load_matcher("auto")).__name__ == "AutoMatcher"  # loads no network yet
    with pytest.raises(InputError, match="expected one of auto, flow, xfeat, roma; got 'sift'"):
        load_matcher("sift")
