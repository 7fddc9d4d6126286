"""Depth maps on any scale, brought to that of the scene."""

import numpy as np
import pytest

from animator.match.depth_lifting import DepthScale, lay_on
from animator.match.sampling import values_at

DEPTHS = np.random.default_rng(0).uniform(2.0, 4.0, 400)


@pytest.mark.parametrize("is_inverse", [False, True])
def test_scale_and_offset_are_found_though_a_fifth_is_elsewhere(is_inverse):
    known = 1.0 / DEPTHS if is_inverse else DEPTHS
    values = 7.0 * known + 30.0
    moved = slice(0, 80)
    nearer = DEPTHS.copy()
    nearer[moved] -= 0.5
    values[moved] = 7.0 * (1.0 / nearer[moved] if is_inverse else nearer[moved]) + 30.0
    scale = lay_on(values, DEPTHS, is_inverse=is_inverse)
    assert scale is not None
    assert scale.misfit(values, DEPTHS) < 0.01
    np.testing.assert_allclose(scale.depths(values), nearer, atol=0.03)


def test_what_would_lie_behind_the_camera_is_unknown():
    scale = DepthScale(slope=1.0, offset=-2.0, is_inverse=False)
    np.testing.assert_array_equal(scale.depths(np.array([1.0, 2.0, 3.0])), [np.nan, np.nan, 1.0])


@pytest.mark.parametrize("values", [np.full(400, 5.0), -DEPTHS], ids=["flat", "upside down"])
def test_a_map_that_says_nothing_or_the_opposite_is_not_laid(values):
    assert lay_on(values, DEPTHS, is_inverse=False) is None


def test_values_are_those_of_the_pixel_and_unknown_outside():
    depth_map = np.arange(6, dtype=np.float32).reshape(2, 3)
    places_px = np.array([[0.1, 0.9], [2.5, 1.5], [3.0, 0.5], [-0.1, 0.5], [np.nan, 1.0]])
    np.testing.assert_array_equal(
        values_at(depth_map, places_px, outside=np.nan), [0, 5, np.nan, np.nan, np.nan]
    )
