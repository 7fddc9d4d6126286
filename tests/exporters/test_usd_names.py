import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Sdf, Tf

from exporters.usd.names import identifier, joint_paths, unique_identifiers


@settings(derandomize=True, max_examples=60, deadline=None)
@given(name=st.text(st.characters(codec="ascii", exclude_characters="\0")))
def test_ascii_names_become_what_usd_makes_of_them(name):
    # With a letter before it: USD overwrites a leading digit, ours stays readable behind "_".
    expected = Tf.MakeValidIdentifier(f"a{name}")[1:]
    assert identifier(name) == (f"_{expected}" if name[:1].isdigit() or not name else expected)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(names=st.lists(st.text(max_size=4), max_size=6))
def test_identifiers_are_valid_and_unique(names):
    unique = unique_identifiers(names)
    assert len(set(unique)) == len(names) == len(unique)
    assert all(Tf.IsValidIdentifier(name) for name in unique)


@pytest.mark.parametrize(
    ("name", "expected"), [("My dog", "My_dog"), ("3d", "_3d"), ("größe", "gr__e"), ("", "_")]
)
def test_identifiers_by_hand(name, expected):
    assert identifier(name) == expected


def test_leaf_names_are_unique_over_the_whole_tree():
    paths = joint_paths(["root", "arm L", "arm/L", "arm_L"], [-1, 0, 1, 0])
    assert paths == ["root", "root/arm_L", "root/arm_L/arm_L_2", "root/arm_L_3"]
    assert all(Sdf.Path.IsValidPathString(path) for path in paths)
