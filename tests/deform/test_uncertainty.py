"""How certain anchors are, against what a textbook says and against cases plain to see."""

import dataclasses

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.deform.anchors import build_anchors
from animator.deform.gauss_newton import MatchProblem, MatchSolverConfig
from animator.deform.uncertainty import FARTHEST_SHIFT, MatchNoise, estimate_uncertainty
from animator.types import AnchorPoses, Anchors, AnchorUncertainty, GaussianMatches
from tests.helpers.objects import box_points, front_camera, gaussians_at

CONFIG = MatchSolverConfig()


@pytest.fixture(scope="module")
def bar() -> tuple[np.ndarray, Anchors, float]:
    points = box_points((0, 0, 0), (1.6, 0.5, 0.5), 1200, 0)
    gaussians = gaussians_at(points)
    return points, build_anchors(gaussians, target_count=30), gaussians.diagonal


def problem_with(bar, is_matched: np.ndarray) -> MatchProblem:
    """Return the bar at rest, with a match for some of its Gaussians."""
    points, anchors, diagonal = bar
    camera = front_camera()
    ids = np.flatnonzero(is_matched)
    matches = GaussianMatches(
        gaussian_ids=ids, target_px=camera.project(points[ids])[0], confidences=np.ones(len(ids))
    )
    return MatchProblem(
        anchors=anchors,
        rest_means=points,
        camera=camera,
        terms=((matches, 1.0),),
        diagonal=diagonal,
        object_px=150.0,
    )


def estimate(bar, is_matched: np.ndarray, **options) -> AnchorUncertainty:
    rest = AnchorPoses.identity(bar[1])
    return estimate_uncertainty(problem_with(bar, is_matched), rest, CONFIG, **options)


@pytest.fixture(scope="module")
def everywhere(bar) -> AnchorUncertainty:
    return estimate(bar, np.full(len(bar[0]), True))


@pytest.mark.parametrize("depth", [4.0, 9.0])
def test_one_anchor_is_as_certain_as_the_pinhole_says(depth):
    """Four points at a distance r around one anchor that cannot turn.

    A shift dx moves a point by f dx / z pixels, a shift dz by f r dz / z^2: with a noise of n pixels
    and four points the standard deviations are n z / (2 f) and n z^2 / (2 f r).
    """
    radius, noise_px = 0.3, 0.8
    points = radius * np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    anchors = Anchors(
        positions=torch.zeros(1, 3),
        spacing=1.0,
        skin_ids=torch.zeros(4, 4, dtype=torch.int32),
        skin_weights=torch.tensor([[1.0, 0, 0, 0]]).expand(4, 4),
        edges=torch.zeros(0, 2, dtype=torch.int64),
        edge_weights=torch.zeros(0),
    )
    camera = front_camera(depth)
    matches = GaussianMatches(
        gaussian_ids=np.arange(4), target_px=camera.project(points)[0], confidences=np.ones(4)
    )
    problem = MatchProblem(
        anchors=anchors,
        rest_means=points,
        camera=camera,
        terms=((matches, 1.0),),
        diagonal=100.0,
        object_px=77.0,
    )
    stiff = MatchSolverConfig(tether=1e-9, rest=0.0, rotation=1e12)
    found = estimate_uncertainty(
        problem,
        AnchorPoses.identity(anchors),
        stiff,
        noise=MatchNoise(hidden_px=noise_px, alike_within_px=1.0),
    )
    focal_px = camera.intrinsics[0, 0]
    assert found.across_ray[0] == pytest.approx(noise_px * depth / (2 * focal_px), rel=1e-3)
    along = noise_px * depth**2 / (2 * focal_px * radius)
    assert found.along_ray[0] == pytest.approx(along, rel=1e-3)


def test_what_is_seen_is_more_certain_than_what_is_not(bar, everywhere):
    """Matches of one half: measured by what all matches say, the other half is worse off."""
    points, anchors, _ = bar
    half = estimate(bar, points[:, 0] < 0)
    places = anchors.positions[:, 0].numpy()
    for field in ("along_ray", "across_ray"):
        losses = getattr(half, field) / getattr(everywhere, field)
        assert losses[places < -0.3].max() < losses[places > 0.3].min()
    assert np.median(half.across_ray[places < -0.3]) < np.median(half.across_ray[places > 0.3]) / 2


def test_one_camera_knows_less_along_its_rays(everywhere):
    assert (everywhere.along_ray > 2 * everywhere.across_ray).all()


def test_more_matches_are_more_certain(bar, everywhere):
    some = estimate(bar, np.arange(len(bar[0])) % 20 == 0)
    assert (some.along_ray > everywhere.along_ray).all()
    assert (some.across_ray > everywhere.across_ray).all()


def test_matches_beside_each_other_count_once(bar):
    is_matched = np.full(len(bar[0]), True)
    alike = estimate(bar, is_matched, noise=MatchNoise(alike_within_px=1e6))
    single = estimate(bar, is_matched, noise=MatchNoise(alike_within_px=1e-6))
    ratio = np.sqrt(len(bar[0]))
    np.testing.assert_allclose(alike.along_ray / single.along_ray, ratio, rtol=0.01)


@settings(derandomize=True, max_examples=8, deadline=None)
@given(factor=st.floats(0.2, 4.0), hidden_px=st.floats(0.1, 1.0))
def test_uncertainty_is_proportional_to_the_pixel_noise(bar, factor, hidden_px):
    is_matched = np.arange(len(bar[0])) % 3 == 0
    one = estimate(bar, is_matched, noise=MatchNoise(hidden_px=hidden_px))
    other = estimate(bar, is_matched, noise=MatchNoise(hidden_px=factor * hidden_px))
    np.testing.assert_allclose(other.along_ray, factor * one.along_ray, rtol=0.01)
    np.testing.assert_allclose(other.across_ray, factor * one.across_ray, rtol=0.01)


def test_residuals_add_to_the_noise_as_independent_errors_do(bar):
    is_matched = np.full(len(bar[0]), True)
    both = estimate(bar, is_matched, residual_px=0.3, noise=MatchNoise(hidden_px=0.4))
    one = estimate(bar, is_matched, noise=MatchNoise(hidden_px=0.5))
    np.testing.assert_allclose(both.along_ray, one.along_ray, rtol=1e-5)


@pytest.mark.parametrize("has_term", [True, False])
def test_without_matches_figures_are_large_and_finite(bar, everywhere, has_term):
    problem = problem_with(bar, np.full(len(bar[0]), False))
    if not has_term:
        problem = dataclasses.replace(problem, terms=())
    found = estimate_uncertainty(problem, AnchorPoses.identity(bar[1]), CONFIG)
    for figures, seen in (
        (found.along_ray, everywhere.along_ray),
        (found.across_ray, everywhere.across_ray),
    ):
        assert (figures > 5 * seen).all()
        assert (figures <= FARTHEST_SHIFT * bar[2]).all()


def test_with_no_prior_at_all_an_unseen_anchor_may_be_a_diagonal_off(bar):
    nothing = MatchSolverConfig(arap=0.0, rotation=0.0, tether=0.0, rest=0.0)
    problem = problem_with(bar, np.full(len(bar[0]), False))
    found = estimate_uncertainty(problem, AnchorPoses.identity(bar[1]), nothing)
    np.testing.assert_allclose(found.along_ray, FARTHEST_SHIFT * bar[2], rtol=1e-4)


def test_lengths_follow_the_unit_of_the_scene(bar, everywhere):
    points, _, _ = bar
    large = gaussians_at(1000 * points)
    anchors = build_anchors(large, target_count=30)
    camera = front_camera(4000.0)
    matches = GaussianMatches(
        gaussian_ids=np.arange(len(points)),
        target_px=camera.project(1000 * points)[0],
        confidences=np.ones(len(points)),
    )
    problem = MatchProblem(
        anchors=anchors,
        rest_means=1000 * points,
        camera=camera,
        terms=((matches, 1.0),),
        diagonal=large.diagonal,
        object_px=150.0,
    )
    found = estimate_uncertainty(problem, AnchorPoses.identity(anchors), CONFIG)
    np.testing.assert_allclose(found.along_ray, 1000 * everywhere.along_ray, rtol=0.01)


def test_the_larger_of_two_frames_counts_between_them():
    one = AnchorUncertainty(along_ray=np.array([1.0, 4.0]), across_ray=np.array([0.5, 0.1]))
    other = AnchorUncertainty(along_ray=np.array([3.0, 2.0]), across_ray=np.array([0.2, 0.3]))
    assert one.or_larger(other).along_ray.tolist() == [3.0, 4.0]
    assert one.or_larger(other).across_ray.tolist() == [0.5, 0.3]
