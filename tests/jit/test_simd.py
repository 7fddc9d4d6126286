"""Every vector operation against numpy, lane by lane."""

import numpy as np
import pytest

from animator.jit import simd
from animator.jit.kernel import kernel
from animator.jit.simd import LANES

_F = np.float32


@kernel(depends_on=(simd,))
def _exercise(left, right, out):
    a = simd.load(np.int64(left.ctypes.data), np.int64(0))
    b = simd.load(np.int64(right.ctypes.data), np.int64(0))
    address = np.int64(out.ctypes.data)
    three = _F(3)
    simd.store(address, 0 * LANES, a + b)
    simd.store(address, 1 * LANES, three - a)
    simd.store(address, 2 * LANES, a * three)
    simd.store(address, 3 * LANES, a / b)
    simd.store(address, 4 * LANES, simd.lane_indices())
    zero, one = simd.splat(_F(0)), simd.splat(_F(1))
    simd.store(address, 5 * LANES, simd.select(a < b, one, zero))
    simd.store(address, 6 * LANES, simd.select((a >= three) | ~(b > _F(0.5)), one, zero))
    simd.store(address, 7 * LANES, simd.select((a <= b) & (a > -three), one, zero))
    return simd.any_lane(a > _F(100)), simd.any_lane(a > _F(-100)), simd.horizontal_sum(a)


def test_arithmetic_comparison_and_selection_act_lane_by_lane():
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-5, 5, LANES).astype(_F), rng.uniform(0.1, 5, LANES).astype(_F)
    out = np.zeros((8, LANES), _F)
    some_large, some_small, total = _exercise(a, b, out)
    expected = [a + b, 3 - a, a * 3, a / b, np.arange(LANES), a < b, (a >= 3) | ~(b > 0.5)]
    np.testing.assert_allclose(out, [*expected, (a <= b) & (a > -3)], rtol=1e-6)
    assert (some_large, some_small) == (False, True)
    assert total == pytest.approx(a.sum(dtype=np.float64), abs=1e-5)


@kernel(depends_on=(simd,))
def _interleave(pixels, planes, back):
    red, green, blue = simd.load_rgb(np.int64(pixels.ctypes.data), np.int64(0))
    address = np.int64(planes.ctypes.data)
    simd.store(address, 0, red)
    simd.store(address, LANES, green)
    simd.store(address, 2 * LANES, blue)
    simd.store_rgb(np.int64(back.ctypes.data), np.int64(0), red, green, blue)


def test_rgb_is_taken_apart_and_put_together():
    pixels = np.arange(3 * LANES, dtype=_F).reshape(LANES, 3)
    planes, back = np.zeros((3, LANES), _F), np.zeros((LANES, 3), _F)
    _interleave(pixels, planes, back)
    np.testing.assert_array_equal(planes, pixels.T)
    np.testing.assert_array_equal(back, pixels)


@kernel(depends_on=(simd,))
def _sum_eight(vectors, out):
    p = np.int64(vectors.ctypes.data)
    simd.store_sums(
        np.int64(out.ctypes.data),
        np.int64(1),
        simd.load(p, np.int64(0)),
        simd.load(p, np.int64(1 * LANES)),
        simd.load(p, np.int64(2 * LANES)),
        simd.load(p, np.int64(3 * LANES)),
        simd.load(p, np.int64(4 * LANES)),
        simd.load(p, np.int64(5 * LANES)),
        simd.load(p, np.int64(6 * LANES)),
        simd.load(p, np.int64(7 * LANES)),
    )


def test_eight_sums_land_in_order_and_nowhere_else():
    vectors = np.arange(8 * LANES, dtype=_F).reshape(8, LANES)
    out = np.full(10, -1, _F)
    _sum_eight(vectors, out)
    np.testing.assert_array_equal(out, [-1, *vectors.sum(axis=1), -1])


@kernel(depends_on=(simd,))
def _apply(values, powers, inverses):
    for place in range(0, values.shape[0], LANES):
        x = simd.load(np.int64(values.ctypes.data), np.int64(place))
        simd.store(np.int64(powers.ctypes.data), np.int64(place), simd.exp2(x))
        y = simd.reciprocal(x * x + _F(1e-3))
        simd.store(np.int64(inverses.ctypes.data), np.int64(place), y)


def test_exp2_and_reciprocal_are_accurate_to_float32():
    values = np.linspace(-125, 126, 1600 * LANES).astype(_F)
    powers, inverses = np.zeros_like(values), np.zeros_like(values)
    _apply(values, powers, inverses)
    np.testing.assert_allclose(powers, np.exp2(values.astype(np.float64)), rtol=4e-7)
    squares = (values * values + _F(1e-3)).astype(np.float64)
    np.testing.assert_allclose(inverses, 1 / squares, rtol=5e-7)


def test_an_impossible_vector_width_is_refused(monkeypatch):
    monkeypatch.setenv("SPLATIMATE_SIMD_LANES", "7")
    with pytest.raises(ValueError, match="expected 8 or 16, found '7'"):
        simd._choose_lanes({})


def test_width_follows_the_cpu(monkeypatch):
    monkeypatch.delenv("SPLATIMATE_SIMD_LANES", raising=False)
    assert simd._choose_lanes({"avx512f": True}) == 16
    assert simd._choose_lanes({"avx2": True}) == 8
    assert simd._choose_lanes({}) == 8
