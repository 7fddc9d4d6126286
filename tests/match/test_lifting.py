"""From pixels to Gaussians, on visibility made by hand."""

import numpy as np
import pytest

from animator.match.lifting import lift_flow, lift_matches, spread_subset
from animator.match.protocol import FlowField
from animator.types import Matches


def _ramp_flow(height: int = 20, width: int = 30) -> FlowField:
    """Displacement (x / 10, y / 5) of the pixel center; trust x / 100."""
    rows, columns = np.mgrid[0:height, 0:width]
    flow = np.stack([(columns + 0.5) / 10, (rows + 0.5) / 5], -1).astype(np.float32)
    return FlowField(flow_px=flow, confidences=((columns + 0.5) / 100).astype(np.float32))


def test_the_flow_is_read_between_pixel_centers():
    centers = np.array([[4.5, 7.5], [10.25, 3.0], [0.1, 19.9]])
    lifted = lift_flow(_ramp_flow(), centers, np.ones(3))
    np.testing.assert_array_equal(lifted.gaussian_ids, [0, 1, 2])
    np.testing.assert_allclose(lifted.target_px[0], [4.5 + 0.45, 7.5 + 1.5], atol=1e-6)
    np.testing.assert_allclose(lifted.target_px[1], [10.25 + 1.025, 3.0 + 0.6], atol=1e-6)
    # Beyond the outermost pixel centers the border pixel is read.
    np.testing.assert_allclose(lifted.target_px[2], [0.1 + 0.05, 19.9 + 3.9], atol=1e-6)
    np.testing.assert_allclose(lifted.confidences, [0.045, 0.1025, 0.005], atol=1e-6)


def test_hidden_untrusted_and_outside_gaussians_are_left_out():
    flow = _ramp_flow()
    flow.confidences[:, :5] = 0
    centers = np.array([[10, 10], [10, 10], [4.9, 10], [5.1, 10], [30.0, 10], [np.nan, 10]])
    shares = np.array([0.31, 0.3, 1, 1, 1, 1])
    np.testing.assert_array_equal(lift_flow(flow, centers, shares).gaussian_ids, [0, 3])


def test_rejected_pixels_do_not_bend_their_neighbors_displacement():
    flow = _ramp_flow()
    flow.flow_px[:, 10] = 1000
    flow.confidences[:, 10] = 0
    lifted = lift_flow(flow, np.array([[9.8, 8.5]]), np.ones(1))
    # Columns 9 (center 9.5) and 10 surround 9.8; only column 9 is trusted.
    np.testing.assert_allclose(lifted.target_px, [[9.8 + 0.95, 8.5 + 1.7]], atol=1e-5)
    np.testing.assert_allclose(lifted.confidences, [0.7 * 0.095], atol=1e-6)


def test_the_cap_keeps_every_part_of_the_image():
    rng = np.random.default_rng(0)
    crowd = rng.uniform(0, 50, (5000, 2))
    lonely = np.array([[190.0, 190.0], [100.0, 5.0], [5.0, 195.0]])
    flow = FlowField(
        flow_px=np.zeros((200, 200, 2), np.float32),
        confidences=np.ones((200, 200), np.float32),
    )
    centers = np.concatenate([crowd, lonely])
    lifted = [
        lift_flow(
            flow, centers, np.ones(5003), max_count=300, rng=np.random.default_rng(seed)
        ).gaussian_ids
        for seed in (1, 1, 2)
    ]
    assert len(lifted[0]) == 300
    assert {5000, 5001, 5002} <= set(lifted[0])
    assert (np.diff(lifted[0]) > 0).all()
    np.testing.assert_array_equal(lifted[0], lifted[1])
    assert (lifted[0] != lifted[2]).any()
    with pytest.raises(ValueError, match="rng"):
        lift_flow(flow, centers, np.ones(5003), max_count=300)


def test_coincident_points_can_be_thinned():
    chosen = spread_subset(np.full((9, 2), 3.0), 4, rng=np.random.default_rng(0))
    assert len(set(chosen)) == 4


def _matches(source, target, confidences) -> Matches:
    return Matches(
        source_px=np.array(source, np.float32),
        target_px=np.array(target, np.float32),
        confidences=np.array(confidences, np.float32),
    )


def test_each_gaussian_keeps_the_nearest_of_its_pixels():
    centers = np.array([[10.0, 10.0], [20.0, 10.0], [30.0, 10.0], [10.1, 10.0]])
    shares = np.array([1.0, 0.9, 0.1, 0.2])  # the last two are hidden
    matches = _matches(
        [[10.5, 10.0], [10.0, 10.2], [20.0, 10.9], [20.0, 11.1], [30.0, 10.0]],
        [[50, 60], [70, 80], [90, 91], [1, 1], [2, 2]],
        [0.5, 0.6, 0.7, 0.8, 0.9],
    )
    lifted = lift_matches(matches, centers, shares)
    np.testing.assert_array_equal(lifted.gaussian_ids, [0, 1])
    # The offset from pixel to Gaussian, (0, -0.2) and (0, -0.9), moves along.
    np.testing.assert_allclose(lifted.target_px, [[70, 79.8], [90, 90.1]], atol=1e-5)
    np.testing.assert_allclose(lifted.confidences, [0.6, 0.7], atol=1e-6)


def test_among_equally_near_pixels_the_surest_wins():
    matches = _matches([[9, 5], [11, 5]], [[1, 1], [2, 2]], [0.4, 0.8])
    lifted = lift_matches(matches, np.array([[10.0, 5.0]]), np.ones(1))
    np.testing.assert_allclose(lifted.target_px, [[1, 2]])


def test_nothing_visible_gives_no_matches():
    matches = _matches([[9, 5]], [[1, 1]], [0.4])
    assert len(lift_matches(matches, np.array([[9.0, 5.0]]), np.zeros(1))) == 0
    assert len(lift_matches(matches, np.array([[np.nan, 5.0]]), np.ones(1))) == 0
