"""Each pixel and each match is shown in one half and hidden in the other."""

import dataclasses

import numpy as np
import pytest
import torch

from animator.deform.frame_target import FrameTarget
from animator.deform.image_difference import ImageOnBlack
from animator.sequence.hidden_cells import halves
from animator.types import GaussianMatches
from tests.helpers.objects import front_camera

HEIGHT, WIDTH = 21, 34


@pytest.fixture
def target() -> FrameTarget:
    rng = np.random.default_rng(0)
    return FrameTarget(
        image=ImageOnBlack(
            rgb=torch.from_numpy(rng.random((HEIGHT, WIDTH, 3))), alpha=torch.ones(HEIGHT, WIDTH)
        ),
        camera=front_camera(3.0, size_px=WIDTH),
        matches=GaussianMatches(
            gaussian_ids=np.arange(50),
            target_px=rng.uniform(-1.0, 1.1, (50, 2)) * (WIDTH, HEIGHT),
            confidences=rng.uniform(0.1, 1.0, 50),
        ),
        object_px=40.0,
    )


def test_two_halves_make_the_frame(target):
    both = list(halves(target, cells=8.0))
    assert len(both) == 2
    for shown, hidden in both:
        torch.testing.assert_close(shown.counted + hidden.counted, torch.ones(HEIGHT, WIDTH))
        torch.testing.assert_close(shown.image.rgb + hidden.image.rgb, target.image.rgb)
        ids = np.concatenate([shown.matches.gaussian_ids, hidden.matches.gaussian_ids])
        assert sorted(ids) == list(range(50))
    torch.testing.assert_close(both[0][0].counted, both[1][1].counted)


def test_cells_are_squares_of_the_objects_size_over_their_number(target):
    shown = next(halves(target, cells=8.0))[0].counted
    assert len(shown[:5, :5].unique()) == 1
    assert shown[0, 0] != shown[0, 5] and shown[0, 0] != shown[5, 0] and shown[0, 0] == shown[5, 5]


def test_a_match_belongs_to_the_cell_it_points_to(target):
    shown = next(halves(target, cells=8.0))[0]
    x, y = np.floor(shown.matches.target_px).astype(int).T
    assert len(x) > 10
    assert (shown.counted.numpy()[y.clip(0, HEIGHT - 1), x.clip(0, WIDTH - 1)] == 1).all()


def test_a_frame_without_matches_stays_without(target):
    shown, hidden = next(halves(dataclasses.replace(target, matches=None), cells=8.0))
    assert shown.matches is None and hidden.matches is None
