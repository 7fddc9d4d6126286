import numpy as np
import pytest

from animator.deform.light_fit import LightFit, LightSamples

LIGHT = np.array([0.1, 0.25, -0.05])


def samples(
    light: np.ndarray, *, count: int = 2000, exposure: float = 0.0, seed: int = 0
) -> LightSamples:
    """Normals that have turned by up to a right angle, a fifth of them wrong."""
    rng = np.random.default_rng(seed)
    normal_changes = rng.standard_normal((count, 3)) * 0.5 + [0.3, 0.4, 0.0]
    log_ratios = normal_changes @ light + exposure + 0.01 * rng.standard_normal(count)
    log_ratios[: count // 5] += rng.uniform(0.2, 0.6, count // 5)
    return LightSamples(normal_changes=normal_changes, log_ratios=log_ratios)


def fit() -> LightFit:
    return LightFit(spread=0.15, noise=0.05, alike=50.0)


def test_finds_the_light_among_wrong_samples():
    estimate = fit()
    estimate.add(samples(LIGHT))
    np.testing.assert_allclose(estimate.light, LIGHT, atol=0.01)


def test_an_exposure_of_each_frame_is_no_light():
    estimate = fit()
    for seed, exposure in enumerate([0.3, -0.2, 0.1]):
        estimate.add(samples(LIGHT, exposure=exposure, seed=seed))
    np.testing.assert_allclose(estimate.light, LIGHT, atol=0.01)


def test_more_frames_tell_more():
    errors = []
    for frames in (1, 20):
        estimate = fit()
        for seed in range(frames):
            estimate.add(samples(LIGHT, count=300, seed=seed))
        errors.append(np.abs(estimate.light - LIGHT).max())
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("count", [0, 500])
def test_what_has_not_turned_shows_no_light(count):
    rng = np.random.default_rng(0)
    estimate = fit()
    estimate.add(
        LightSamples(
            normal_changes=np.zeros((count, 3)), log_ratios=0.1 * rng.standard_normal(count)
        )
    )
    assert not estimate.light.any()
