"""Gaussians in the air beside an object."""

import dataclasses
import logging

import numpy as np
import pytest
import torch

from animator.deform.anchors import build_anchors
from animator.deform.floaters import find_floaters, without_floaters
from animator.types import Gaussians
from tests.helpers.textured import textured_box

COUNT = 1500


def joined(*pieces: Gaussians) -> Gaussians:
    return Gaussians(
        **{
            field.name: torch.cat([getattr(piece, field.name) for piece in pieces])
            for field in dataclasses.fields(Gaussians)
        }
    )


def moved(gaussians: Gaussians, places: np.ndarray) -> Gaussians:
    """The first Gaussians, as many as there are places, at the places."""
    fields = {
        field.name: getattr(gaussians, field.name)[: len(places)]
        for field in dataclasses.fields(Gaussians)
    }
    return Gaussians(**{**fields, "means": torch.as_tensor(places, dtype=torch.float32)})


@pytest.fixture(scope="module")
def box() -> Gaussians:
    return textured_box(COUNT)


@pytest.fixture(scope="module")
def dust(box) -> Gaussians:
    """Forty Gaussians all around, farther from each other and the box than they reach."""
    directions = np.random.default_rng(0).normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return moved(box, 5.0 * directions)


def test_what_overlaps_nothing_floats_and_the_object_does_not(box, dust):
    floats = find_floaters(joined(box, dust))
    np.testing.assert_array_equal(floats, np.arange(COUNT + 40) >= COUNT)
    assert not find_floaters(box).any()


def test_a_sizable_piece_apart_belongs_to_the_object(box):
    places = box.means[:400].numpy() + np.array([9.0, 0.0, 0.0])
    dense = moved(box, places)
    dense = dataclasses.replace(dense, scales=torch.full_like(dense.scales, 0.2))
    assert not find_floaters(joined(box, dense)).any()


def test_where_nothing_overlaps_nothing_can_be_told(box):
    assert not find_floaters(dataclasses.replace(box, scales=1e-3 * box.scales)).any()


def test_faint_gaussians_neither_float_nor_join(box, dust):
    faint = dataclasses.replace(dust, opacities=torch.full_like(dust.opacities, 0.05))
    assert not find_floaters(joined(box, faint)).any()


def test_floaters_are_counted_made_invisible_and_get_no_anchors(box, dust, caplog):
    both = joined(box, dust)
    with caplog.at_level(logging.WARNING):
        solid = without_floaters(both)
    assert "40 of 1,540 Gaussians" in caplog.text
    assert len(solid) == len(both)
    assert (solid.opacities[COUNT:] == 0).all()
    torch.testing.assert_close(solid.opacities[:COUNT], box.opacities)
    found, alone = (build_anchors(one, target_count=30) for one in (solid, box))
    torch.testing.assert_close(found.positions, alone.positions)
    assert len(found.skin_ids) == len(both)


def test_a_clean_model_is_left_as_it_is(box, caplog):
    assert without_floaters(box) is box
    assert not caplog.records


@pytest.mark.parametrize("count", [0, 1, 2])
def test_hardly_any_gaussians(box, count):
    few = moved(box, box.means[:count].numpy())
    assert len(find_floaters(few)) == count
