import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.evaluation.carried_points import CarriedPoints
from tests.helpers.objects import box_points, gaussians_at

POINTS = box_points((0, 0, 0), (1, 1, 1), 30, seed=1)
SHIFT = np.array([1.0, 2.0, 3.0])
GAUSSIANS = gaussians_at(box_points((0, 0, 0), (1, 1, 1), 200, seed=2))


def test_points_stay_at_rest_and_follow_a_shift_exactly():
    carried = CarriedPoints.on_surface(POINTS, GAUSSIANS, diagonal=1.7)
    rest = GAUSSIANS.means.numpy()
    np.testing.assert_allclose(carried.at(rest), POINTS, atol=1e-12)
    np.testing.assert_allclose(carried.at(rest + SHIFT), POINTS + SHIFT, atol=1e-6)


def test_nearer_gaussians_carry_more_and_faint_ones_nothing():
    gaussians = gaussians_at(np.array([[0.0, 0, 0], [1, 0, 0], [4, 0, 0], [9, 0, 0], [0.1, 0, 0]]))
    faint = torch.tensor([0.9, 0.9, 0.9, 0.9, 0.2])
    gaussians = dataclasses.replace(gaussians, opacities=faint)
    point = np.array([[0.25, 0.0, 0.0]])
    carried = CarriedPoints.on_surface(point, gaussians, diagonal=0.0)
    inverse = 1 / np.array([0.25, 0.75, 3.75, 8.75])
    assert carried.gaussian_ids.tolist() == [[0, 1, 2, 3]]
    np.testing.assert_allclose(carried.weights[0], inverse / inverse.sum())
    values = np.array([1.0, 2, 3, 4, 1e9])
    assert carried.average(values)[0] == pytest.approx(values[:4] @ inverse / inverse.sum())


def test_few_gaussians_are_enough():
    gaussians = gaussians_at(np.array([[0.0, 0, 0], [1, 0, 0]]), opacity=0.1)
    carried = CarriedPoints.on_surface(np.zeros((1, 3)), gaussians, diagonal=1.0)
    assert carried.weights.shape == (1, 2)


def test_centers_move_as_their_gaussians_do():
    ids = np.array([3, 77, 150])
    rest = GAUSSIANS.means.numpy()
    turned = Rotation.from_euler("z", 50, degrees=True).apply(rest)
    carried = CarriedPoints.on_centers(ids, GAUSSIANS)
    np.testing.assert_allclose(carried.at(turned), turned[ids], atol=1e-12)
