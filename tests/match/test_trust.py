"""The gates that decide which displacements are believed."""

import numpy as np

from animator.match.trust import (
    NormalizedPair,
    TrustLimits,
    local_correlation,
    round_trip_error,
    trusted_flow,
)

SHAPE = (40, 50)


def _constant_flow(x: float, y: float) -> np.ndarray:
    return np.full((*SHAPE, 2), (x, y), np.float32)


def _noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, SHAPE, np.uint8)


def test_the_round_trip_adds_both_flows():
    error = round_trip_error(_constant_flow(3, 0), _constant_flow(-3, 4))
    np.testing.assert_allclose(error, 4.0, atol=1e-5)


def test_the_way_back_is_read_where_the_way_there_ends():
    forward = _constant_flow(10, 0)
    backward = _constant_flow(0, 0)
    backward[:, 20:] = -10, 0  # only pixels that land right of column 20 get home
    error = round_trip_error(forward, backward)
    np.testing.assert_allclose(error[:, 10:], 0, atol=1e-5)
    np.testing.assert_allclose(error[:, :9], 10, atol=1e-5)


def test_correlation_is_one_for_equal_minus_one_for_inverted_patches():
    image = _noise(0)
    same = local_correlation(image, image, _constant_flow(0, 0), blur_px=3.0)
    inverted = local_correlation(image, 255 - image, _constant_flow(0, 0), blur_px=3.0)
    other = local_correlation(image, _noise(1), _constant_flow(0, 0), blur_px=3.0)
    np.testing.assert_allclose(same, 1, atol=1e-3)
    np.testing.assert_allclose(inverted, -1, atol=1e-2)
    assert np.abs(other).max() < 0.5


def test_trust_falls_with_the_round_trip_and_ends_at_the_limit():
    image, everywhere = _noise(2), np.ones(SHAPE, bool)
    pair = NormalizedPair(
        source_gray=image, target_gray=image, source_mask=everywhere, target_mask=everywhere
    )

    def trust(error_px: float) -> float:
        flows = (_constant_flow(0, 0), _constant_flow(error_px, 0))
        limits = TrustLimits(round_trip_px=2.0)
        flow = trusted_flow(pair, flows, limits=limits, matcher="test")
        return float(flow.confidences[20, 25])

    assert abs(trust(0.0) - 1.0) < 1e-3
    assert abs(trust(1.0) - 0.75) < 1e-3
    assert trust(2.0) == 0.0
