"""The norm of residuals that lets joints bend."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.deform.robust_norm import RobustNorm

squares = st.floats(0.0, 10.0)
reaches = st.floats(0.01, 2.0)
floors = st.floats(0.0, 1.0)


def test_plain_squares_without_a_reach():
    squared = np.array([0.0, 0.3, 7.0])
    np.testing.assert_array_equal(RobustNorm().cost(squared), squared)
    np.testing.assert_array_equal(RobustNorm().weight(squared), np.ones(3))


def test_half_the_square_at_the_reach_and_bounded_beyond():
    norm = RobustNorm(reach=0.2)
    assert norm.cost(np.array(0.04)) == pytest.approx(0.02)
    assert norm.weight(np.array(0.04)) == pytest.approx(0.25)
    assert norm.cost(np.array(1e9)) == pytest.approx(0.04)


def test_one_bent_joint_is_cheaper_than_the_same_bend_spread_out():
    norm = RobustNorm(reach=0.1)
    spread, one = np.full(10, 0.2), np.eye(10)[0] * 2.0
    assert norm.cost(one**2).sum() < norm.cost(spread**2).sum()
    assert (one**2).sum() > (spread**2).sum()


@settings(max_examples=50, derandomize=True, deadline=None)
@given(squares, reaches, floors)
def test_the_weight_is_the_slope_of_the_cost(squared, reach, floor):
    norm = RobustNorm(reach=reach, floor=floor)
    live = torch.tensor(squared, dtype=torch.float64, requires_grad=True)
    norm.cost(live).backward()
    assert float(live.grad) == pytest.approx(float(norm.weight(np.array(squared))), rel=1e-9)
