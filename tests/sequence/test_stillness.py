"""Frames that show nothing new, made by hand: noise alone, and motion of a fraction of a pixel."""

import dataclasses

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.sequence.stillness import shows_the_same
from animator.sequence.target import FrameView


def view(*, shift_px: float = 0.0, noise: float = 0.0, seed: int = 0) -> FrameView:
    """A checkered disk of 60 px; moved, and filmed with normal noise of a level."""
    rows, columns = np.mgrid[:80, :100].astype(np.float32)
    is_light = (np.floor(rows / 9) + np.floor(columns / 9)) % 2
    rgb = np.repeat((60 + 120 * is_light)[..., None], 3, axis=2)
    alpha = 255.0 * (np.hypot(rows - 40, columns - 45) < 30)
    stacked = cv2.GaussianBlur(np.dstack([rgb, alpha]), (5, 5), 1.0)
    move = np.array([[1.0, 0, shift_px], [0, 1, 0]], np.float32)
    stacked = cv2.warpAffine(stacked, move, (100, 80), flags=cv2.INTER_LINEAR)
    stacked[..., :3] += np.random.default_rng(seed).normal(0, noise, (80, 100, 3))
    pixels = stacked.round().clip(0, 255).astype(np.uint8)
    return FrameView(rgb=pixels[..., :3], alpha=pixels[..., 3])


def test_a_frame_shows_the_same_as_itself():
    assert shows_the_same(view(), view())


@settings(derandomize=True, max_examples=10, deadline=None)
@given(noise=st.floats(0.0, 2.0), seed=st.integers(0, 1000))
def test_noise_is_no_motion(noise, seed):
    assert shows_the_same(view(noise=noise, seed=seed), view(noise=noise, seed=seed + 1))


@settings(derandomize=True, max_examples=10, deadline=None)
@given(shift_px=st.floats(0.25, 3.0), noise=st.floats(0.0, 2.0), sign=st.sampled_from([-1, 1]))
def test_a_quarter_of_a_pixel_is_motion(shift_px, noise, sign):
    moved = view(shift_px=sign * shift_px, noise=noise, seed=1)
    assert not shows_the_same(moved, view(noise=noise))


def test_one_small_part_that_moves_is_seen():
    before = view(noise=1.0)
    rgb = before.rgb.copy()
    rgb[30:36, 40:46] = np.roll(rgb[30:36, 40:46], 2, axis=1) // 2
    assert not shows_the_same(dataclasses.replace(before, rgb=rgb), before)


def test_what_happens_outside_the_mask_does_not_count():
    before = view()
    rgb = np.where(before.alpha[..., None] > 0, before.rgb, 255 - before.rgb)
    assert shows_the_same(dataclasses.replace(before, rgb=rgb), before)


@pytest.mark.parametrize("alpha", [0, 255])
def test_empty_and_full_masks(alpha):
    flat = FrameView(
        rgb=np.full((20, 30, 3), 90, np.uint8), alpha=np.full((20, 30), alpha, np.uint8)
    )
    assert shows_the_same(flat, flat)
