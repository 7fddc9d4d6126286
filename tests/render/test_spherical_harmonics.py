"""The real basis against scipy's complex harmonics."""

import numpy as np
import pytest
import torch
from dense_reference import real_harmonic

from animator.render.spherical_harmonics import evaluate_colors


@pytest.mark.parametrize("index", range(16))
def test_each_basis_function_is_the_real_spherical_harmonic(index):
    order = int(index**0.5)
    m = index - order * order - order
    points = np.random.default_rng(index).normal(size=(20, 3))
    coefficients = torch.zeros(20, 16, 3, dtype=torch.float64)
    coefficients[:, index] = 0.1
    colors = evaluate_colors(coefficients, torch.from_numpy(points), torch.zeros(3).double())
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    expected = 0.5 + 0.1 * real_harmonic(directions, order, m)
    np.testing.assert_allclose(colors, np.tile(expected[:, None], 3), atol=1e-12)


def test_colors_are_not_negative():
    assert not evaluate_colors(torch.full((2, 1, 3), -9.0), torch.zeros(2, 3), torch.zeros(3)).any()


def test_a_wrong_number_of_coefficients_is_refused():
    with pytest.raises(ValueError, match=r"1, 4, 9 or 16 .* found 5"):
        evaluate_colors(torch.zeros(2, 5, 3), torch.zeros(2, 3), torch.zeros(3))
