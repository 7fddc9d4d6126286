"""The rules on plain arrays, by hand."""

import numpy as np
import pytest

from exporters.check import gaussians, influences, numbers
from exporters.check.problem import Problem, count_bad


def test_a_problem_reads_as_a_sentence() -> None:
    problem = Problem(place="/Lamp.points", expected="12 values", found="3")
    assert str(problem) == "/Lamp.points: expected 12 values, found 3"


def test_bad_entries_are_counted_and_the_first_is_named() -> None:
    is_bad = np.array([[False, False], [False, True], [True, False]])
    (problem,) = count_bad("here", is_bad, expected="good ones", what="bad ones")
    assert problem.found == "2 bad ones (first at (1, 1))"
    assert [*count_bad("here", is_bad[:1], expected="good ones", what="bad ones")] == []


def found(problems) -> list[str]:
    return [problem.found for problem in problems]


def test_a_number_that_is_not_finite_is_said_once() -> None:
    nan = np.array([[np.nan, 0, 0, 1], [0, 0, 0, 1]], np.float32)
    assert len([*numbers.finite("q", nan)]) == 1
    assert [*numbers.unit_quaternions("q", nan)] == []
    assert [*numbers.continuous_signs("q", nan, nan)] == []
    assert [*gaussians.linear_scales("s", nan[:1, :1])] == []


def test_half_a_turn_is_no_jump_and_a_sign_is() -> None:
    quats = np.array([[1, 0, 0, 0], [-1e-8, 1, 0, 0], [0, 0.9, 0.1, 0], [0, -0.9, -0.1, 0]])
    assert found(numbers.continuous_signs("q", quats[:-1], quats[1:])) == [
        "1 whose sign jumps (first at 2)"
    ]


def test_sixteen_bit_quaternions_count_as_unit() -> None:
    rng = np.random.default_rng(0)
    quats = rng.normal(size=(1000, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    assert [*numbers.unit_quaternions("q", quats.astype(np.float16))] == []
    assert found(numbers.unit_quaternions("q", quats * 1.01))[0].startswith("1000 ")


@pytest.mark.parametrize(
    ("times", "count"), [([0, 1, 2], 0), ([0, 1, 1], 1), ([0, 2, 1], 1), ([-1, 0], 1)]
)
def test_times_increase_from_zero(times, count) -> None:
    assert len([*numbers.key_times("t", np.array(times, float), unit="s")]) == count


def test_influences() -> None:
    ids = np.array([[0, 1, 0, 0], [2, 2, 0, 0], [1, 1, 0, 0]])
    weights = np.array([[0.5, 0.5, 0, 0], [0.5, 0.5, 0, 0], [1, 0, 0, 0]], np.float32)
    assert found(influences.joint_indices("j", ids, 2)) == [
        "1 vertices with another joint (first at 1)"
    ]
    assert [*influences.weights("w", weights)] == []
    # Vertex 2 names joint 1 twice, but follows it once.
    assert found(influences.distinct_joints("j", ids, weights)) == [
        "1 vertices that follow one joint twice (first at 1)"
    ]
    assert [*influences.distinct_joints("j", ids[:, :1], weights[:, :1])] == []
    assert len([*influences.weights("w", weights * [1, 1, 1, 1] - [[0, 0, 0.1, 0]])]) == 2


def test_an_ellipsoid_may_fit_where_a_ball_does_not() -> None:
    quarter_turn_z_xyzw = np.array([[0, 0, np.sqrt(0.5), np.sqrt(0.5)]])
    positions, scales = np.zeros((1, 3)), np.array([[1.0, 0.1, 0.1]])
    turned = np.array([[-0.3, -3, -0.3], [0.3, 3, 0.3]])  # the long axis now lies along y
    rules = gaussians.ellipsoids_in_extent
    assert [*rules("e", turned, positions, quarter_turn_z_xyzw, scales)] == []
    assert [*rules("e", turned[:, [1, 0, 2]], positions, quarter_turn_z_xyzw, scales)] != []
    assert [*rules("e", turned * 0.99, positions, quarter_turn_z_xyzw, scales)] != []
