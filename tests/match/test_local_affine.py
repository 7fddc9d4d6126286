"""Agreement with neighbors, and interpolation between matches."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.match import local_affine
from animator.match.local_affine import agreeing_matches, interpolate_flow


def _affine(points: np.ndarray) -> np.ndarray:
    """A turn by 20 degrees with some shear, and a large shift."""
    linear = np.array([[0.97, -0.34], [0.30, 0.94]])
    return points @ linear.T + np.array([60.0, -12.0])


@settings(derandomize=True, max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000), outlier_share=st.floats(0.0, 0.3))
def test_outliers_are_found_and_nothing_else(seed, outlier_share):
    rng = np.random.default_rng(seed)
    source = rng.uniform(0, 300, (400, 2))
    target = _affine(source) + rng.normal(0, 0.5, source.shape)
    is_outlier = rng.random(400) < outlier_share
    away = rng.uniform(20, 80, is_outlier.sum())
    angle = rng.uniform(0, 2 * np.pi, is_outlier.sum())
    target[is_outlier] += away[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    kept = agreeing_matches(source, target)
    assert not kept[is_outlier].any()
    assert kept[~is_outlier].mean() > 0.9


def test_two_parts_that_move_apart_both_survive():
    rng = np.random.default_rng(3)
    source = rng.uniform(0, 200, (600, 2))
    target = source + np.where(source[:, :1] < 100, (-30.0, 0.0), (30.0, 10.0))
    assert agreeing_matches(source, target).mean() > 0.9


def test_too_few_matches_are_all_refused():
    points = np.random.default_rng(0).uniform(0, 9, (12, 2))
    assert not agreeing_matches(points, points).any()
    assert agreeing_matches(np.zeros((0, 2)), np.zeros((0, 2))).shape == (0,)


def test_an_affine_motion_is_interpolated_almost_exactly():
    rng = np.random.default_rng(4)
    source = rng.uniform(0, 120, (150, 2))
    flow = interpolate_flow(source, _affine(source), height_px=100, width_px=120)
    assert flow.shape == (100, 120, 2) and flow.dtype == np.float32
    rows, columns = np.mgrid[0:100, 0:120]
    centers = np.stack([columns + 0.5, rows + 0.5], -1)
    errors = np.linalg.norm(centers + flow - _affine(centers), axis=-1)
    # What remains is the pull to the identity where neighbors are close together.
    assert np.median(errors) < 0.15
    assert np.percentile(errors, 90) < 0.5


def test_a_pure_shift_is_interpolated_exactly_even_from_one_match():
    flow = interpolate_flow(
        np.array([[10.5, 7.5]]), np.array([[13.0, 7.25]]), height_px=17, width_px=23
    )
    np.testing.assert_allclose(flow, np.full((17, 23, 2), (2.5, -0.25)), atol=1e-3)


@pytest.mark.parametrize("chunk", [7, 100])
def test_chunks_do_not_change_the_result(monkeypatch, chunk):
    rng = np.random.default_rng(5)
    source = rng.uniform(0, 90, (120, 2))
    target = _affine(source) + rng.normal(0, 2, source.shape)
    kept = agreeing_matches(source, target)
    flow = interpolate_flow(source, target, height_px=90, width_px=90)
    monkeypatch.setattr(local_affine, "CHUNK", chunk)
    np.testing.assert_array_equal(agreeing_matches(source, target), kept)
    np.testing.assert_allclose(
        interpolate_flow(source, target, height_px=90, width_px=90), flow, atol=1e-4
    )
