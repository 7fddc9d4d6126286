import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.report import quality
from exporters import quaternions


def test_psnr_counts_the_mask_only():
    first = np.zeros((2, 2, 3))
    second = np.zeros((2, 2, 3))
    second[0, 0] = 0.1  # inside
    second[1, 1] = 1.0  # outside
    mask = np.array([[True, True], [False, False]])
    # Mean squared difference over two pixels: 0.01 / 2.
    assert quality.masked_psnr_db(first, second, mask) == pytest.approx(10 * np.log10(200))


def test_psnr_of_equal_images_is_capped_and_of_nothing_is_nan():
    image = np.full((1, 1, 3), 0.3)
    assert quality.masked_psnr_db(image, image, np.array([[True]])) == 100.0
    assert np.isnan(quality.masked_psnr_db(image, image, np.array([[False]])))


def test_iou_by_hand():
    first = np.array([[1, 1, 0, 0]], bool)
    second = np.array([[0, 1, 1, 0]], bool)
    assert quality.silhouette_iou(first, second) == pytest.approx(1 / 3)
    assert quality.silhouette_iou(first, ~first) == 0
    assert quality.silhouette_iou(first & ~first, first & ~first) == 1


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, derandomize=True, deadline=None)
def test_rigid_motion_leaves_no_residual_even_for_flat_groups(seed):
    rng = np.random.default_rng(seed)
    rest = rng.normal(size=(30, 3))
    rest[:10, 2] = 0.5  # a plane: the sign of the normal is free in a naive fit
    labels = np.repeat([0, 1, -1], 10)
    posed = rng.normal(size=(30, 3))
    for label in (0, 1):
        turn = quaternions.to_matrices(quaternions.normalize(rng.normal(size=4)))
        posed[labels == label] = rest[labels == label] @ turn.T + rng.normal(size=3)
    assert quality.rigid_residual(rest, posed, labels) < 1e-6


def test_a_mirrored_group_is_not_rigid():
    rest = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    rest[0, 0] = 2.0  # no symmetry that a rotation could use
    rest[2, 1] = 3.0
    mirrored = rest * [-1.0, 1.0, 1.0]
    assert quality.rigid_residual(rest, mirrored, np.zeros(6, int)) > 0.1


def test_stretching_leaves_the_residual_worked_out_by_hand():
    rest = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]])
    posed = np.array([[-2.0, 0, 5], [2, 0, 5], [0, 0, 5], [9, 9, 9]])
    labels = np.array([0, 0, 0, -1])
    # The two ends miss by 1 each, the middle by 0: sqrt((1 + 1 + 0) / 3).
    assert quality.rigid_residual(rest, posed, labels) == pytest.approx(np.sqrt(2 / 3))


def test_without_groups_there_is_no_residual():
    assert np.isnan(quality.rigid_residual(np.eye(3), np.eye(3), np.full(3, -1)))


def test_largest_distance_by_hand():
    first = np.zeros((3, 3))
    second = np.array([[0, 0, 0], [0, 3, 4], [1, 1, 1]])
    assert quality.largest_distance(first, second) == 5


def test_weighted_share_by_hand():
    is_counted = np.array([True, False, True])
    assert quality.weighted_share(is_counted, np.array([0.1, 0.7, 0.2])) == pytest.approx(0.3)
    assert quality.weighted_share(is_counted, np.zeros(3)) == 0


def test_the_spread_of_figures_by_hand():
    spread = quality.Spread.of(np.arange(101.0))
    assert (spread.median, spread.p95) == (50.0, 95.0)
    assert np.isnan(quality.Spread.of(np.zeros(0)).median)
