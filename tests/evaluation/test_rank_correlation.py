import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import spearmanr

from animator.evaluation.rank_correlation import correlation


@settings(derandomize=True, max_examples=10)
@given(st.integers(0, 10_000), st.integers(3, 60))
def test_it_is_spearmans(seed, count):
    rng = np.random.default_rng(seed)
    errors = rng.integers(0, 10, (2, count)).astype(float)  # with ties
    uncertainties = errors + rng.normal(0, 4, (2, count))
    expected = spearmanr(errors.ravel(), uncertainties.ravel()).statistic
    if np.isfinite(expected):
        assert correlation(errors, uncertainties) == pytest.approx(expected)


def test_only_the_order_counts():
    errors = np.array([1.0, 2, 3, 10])
    assert correlation(errors, np.exp(errors)) == pytest.approx(1.0)
    assert correlation(errors, -(errors**3)) == pytest.approx(-1.0)


def test_what_is_not_claimed_does_not_count():
    errors = np.array([1.0, 2, 3, 4])
    assert correlation(errors, np.array([1.0, np.nan, 3, 4])) == pytest.approx(1.0)
    assert np.isnan(correlation(errors, np.full(4, np.nan)))
    assert np.isnan(correlation(errors, np.ones(4)))
