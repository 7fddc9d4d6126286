import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.deform.normal_equations import UNKNOWNS, NormalEquations, Residuals


def random_residuals(rng: np.random.Generator, count: int, rows: int, kept: int) -> Residuals:
    """Residuals that depend on anchors near each other, some of them named twice."""
    terms = 3 * count
    first = rng.integers(0, count, (terms, 1))
    ids = np.clip(first + rng.integers(-2, 3, (terms, kept)), 0, count - 1)
    return Residuals(
        values=rng.normal(size=(terms, rows)),
        jacobian=rng.normal(size=(terms, rows, kept, UNKNOWNS)),
        anchor_ids=ids,
    )


def dense(residuals: Residuals, count: int) -> tuple[np.ndarray, np.ndarray]:
    """J and r of the whole, shapes (E R, 6 A) and (E R,)."""
    terms, rows, kept, _ = residuals.jacobian.shape
    jacobian = np.zeros((terms, rows, count, UNKNOWNS))
    for e in range(terms):
        for k in range(kept):
            jacobian[e, :, residuals.anchor_ids[e, k]] += residuals.jacobian[e, :, k]
    return jacobian.reshape(terms * rows, -1), residuals.values.ravel()


@settings(derandomize=True, max_examples=40, deadline=None)  # the first call compiles
@given(st.integers(0, 2**32 - 1), st.integers(1, 25))
def test_equals_the_dense_products(seed, count):
    rng = np.random.default_rng(seed)
    scattered = rng.permutation(count)
    parts = [random_residuals(rng, count, 2, 4), random_residuals(rng, count, 3, 2)]
    parts = [
        Residuals(values=p.values, jacobian=p.jacobian, anchor_ids=scattered[p.anchor_ids])
        for p in parts
    ]
    weights, pulls = rng.random((count, UNKNOWNS)), rng.normal(size=(count, UNKNOWNS))
    equations = NormalEquations(count, [part.anchor_ids for part in parts])
    for _ in range(2):  # the second time nothing of the first is left
        equations.clear()
        for part in parts:
            equations.add(part)
        equations.add_diagonal(weights, pulls)

    normal, gradient = np.diag(weights.ravel()), pulls.ravel().copy()
    for part in parts:
        jacobian, values = dense(part, count)
        normal += jacobian.T @ jacobian
        gradient += jacobian.T @ values
    np.testing.assert_allclose(equations.matrix(), normal, atol=1e-9 * np.abs(normal).max())
    damped = normal + np.diag(0.01 * normal.diagonal())
    expected = -np.linalg.solve(damped, gradient).reshape(-1, UNKNOWNS)
    np.testing.assert_allclose(equations.step(0.01), expected, rtol=1e-6, atol=1e-9)


def test_a_chain_in_any_order_has_a_narrow_band():
    scattered = np.random.default_rng(0).permutation(200)
    links = np.stack([scattered[:-1], scattered[1:]], axis=1)
    equations = NormalEquations(200, [links])
    assert equations._band.shape == (200 * UNKNOWNS, 2 * UNKNOWNS)


@pytest.mark.parametrize("count", [1, 3])
def test_without_residuals_nothing_moves(count):
    equations = NormalEquations(count, [])
    equations.add_diagonal(np.ones((count, UNKNOWNS)), np.zeros((count, UNKNOWNS)))
    assert np.array_equal(equations.step(0.0), np.zeros((count, UNKNOWNS)))
