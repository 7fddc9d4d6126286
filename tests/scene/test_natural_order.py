import string

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.scene.natural_order import (
    describe_ranges,
    frame_numbers,
    last_number,
    missing_ranges,
    natural_key,
)

NAMES = st.text(string.ascii_letters + string.digits + "._-", max_size=12)


def test_digits_sort_by_value():
    names = ["f10.png", "f9.png", "f1.png", "F2.png", "f010.png", "a.png"]
    assert sorted(names, key=natural_key) == [
        "a.png",
        "f1.png",
        "F2.png",
        "f9.png",
        "f010.png",
        "f10.png",
    ]


@settings(derandomize=True, max_examples=50)
@given(st.lists(NAMES, unique=True), st.randoms(use_true_random=False))
def test_order_does_not_depend_on_the_start(names, random):
    shuffled = list(names)
    random.shuffle(shuffled)
    assert sorted(names, key=natural_key) == sorted(shuffled, key=natural_key)


@settings(derandomize=True, max_examples=50)
@given(st.lists(st.integers(0, 10**9), unique=True), st.integers(1, 6))
def test_numbered_names_sort_like_their_numbers(numbers, width):
    names = [f"frame_{number:0{width}d}.png" for number in numbers]
    in_order = sorted(names, key=natural_key)
    assert [last_number(name) for name in in_order] == sorted(numbers)
    if names:
        assert frame_numbers(in_order) == tuple(sorted(numbers))


def test_very_long_digits_are_no_number():
    assert last_number("9" * 5000 + ".png") is None
    assert sorted(["9" * 5000, "1" * 5000], key=natural_key)[0][0] == "1"


def test_a_constant_last_number_gives_way_to_the_one_that_counts():
    assert frame_numbers(["f0003_1080p.png", "f0007_1080p.png"]) == (3, 7)


@pytest.mark.parametrize("names", [["left.png", "right.png"], ["a1.png", "b1.png"]])
def test_names_without_growing_number_fall_back_to_position(names, caplog):
    assert frame_numbers(names) == (0, 1)
    assert "by position" in caplog.text


@pytest.mark.parametrize(
    ("numbers", "gaps"),
    [
        ((), ()),
        ((5,), ()),
        ((0, 1, 2), ()),
        ((0, 6, 12), ()),
        ((1, 2, 4, 8), ((3, 3), (5, 7))),
        ((0, 6, 18), ((12, 12),)),
        ((0, 2, 7), ((4, 6),)),
    ],
)
def test_gaps(numbers, gaps):
    assert missing_ranges(numbers) == gaps


def test_long_lists_of_ranges_are_cut():
    assert describe_ranges([(1, 1), (3, 5), (9, 9)], shown=2) == "1, 3-5 and 1 more"
