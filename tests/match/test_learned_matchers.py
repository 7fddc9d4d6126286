"""XFeat, the choice between matchers, and view retrieval; one network for all tests."""

import logging

import numpy as np
import pytest
from textured_pairs import (
    SIDE_PX,
    Affine,
    Texture,
    centers,
    disk,
    flow_errors,
    image_of,
    moved_pair,
)

from animator.match.auto import AutoMatcher
from animator.match.features import FeatureMatcher
from animator.match.flow import FlowMatcher
from animator.match.protocol import MaskedImage
from animator.match.sampling import inside_mask
from animator.match.view_retrieval import occupied_cells, rank_views
from animator.match.xfeat import XFeatMatcher
from animator.types import Matches

LARGE = Affine(angle_deg=12.0, shift_px=(55.0, 25.0))  # 60 px
LARGE_PAIR = {"center": (95.0, 110.0), "radius_px": 60.0}


@pytest.fixture(scope="module")
def features() -> FeatureMatcher:
    return FeatureMatcher(keypoint_count=1024)


def test_loading_prints_nothing(capsys):
    FeatureMatcher()
    assert capsys.readouterr().out == ""


def test_xfeat_follows_a_motion_that_optical_flow_loses(features):
    source, target = moved_pair(LARGE, seed=5, **LARGE_PAIR)
    assert FlowMatcher().flow(source, target).trusted_share(source.mask) < 0.3
    flow = XFeatMatcher(features=features).flow(source, target)
    errors = flow_errors(flow, LARGE)
    assert flow.trusted_share(source.mask) > 0.7
    assert np.median(errors) < 0.3
    assert np.percentile(errors, 90) < 1.0
    assert not flow.confidences[~source.mask].any()


def test_xfeat_gives_the_same_bytes_again(features):
    pair = moved_pair(LARGE, seed=5, **LARGE_PAIR)
    matches = [XFeatMatcher(features=matcher).match(*pair) for matcher in (features, features)]
    assert matches[0].target_px.tobytes() == matches[1].target_px.tobytes()
    assert matches[0].confidences.tobytes() == matches[1].confidences.tobytes()


def test_xfeat_falls_back_to_flow_without_seeds(features):
    here = centers()
    mask = disk((128, 128), 5)(here)
    dot = image_of(np.full((*mask.shape, 3), 100.0), mask)
    flow = XFeatMatcher(features=features).flow(dot, dot)
    assert flow.matcher == "flow"
    assert np.abs(flow.flow_px[mask]).max() < 0.1


def test_keypoints_are_positions_in_the_image_that_was_given(features):
    source, target = moved_pair(Affine(shift_px=(32.0, 7.0)), seed=6)
    uncropped = features.extract_uncropped(source)
    np.testing.assert_array_equal(uncropped.keypoints_px.numpy() % 1, 0.5)
    assert inside_mask(source.mask, uncropped.keypoints_px.numpy()).all()
    # The crops of source and target have different origins and are both enlarged.
    for match in (features.match, features.match_mutual):
        matches = match(features.extract(source), features.extract(target))
        moved = matches.target_px - matches.source_px
        np.testing.assert_allclose(np.median(moved, axis=0), (32.0, 7.0), atol=0.3)
        assert (np.linalg.norm(moved - (32.0, 7.0), axis=1) < 3).mean() > 0.7


@pytest.mark.parametrize(
    ("motion", "options", "choice"),
    [
        (Affine(shift_px=(2.0, 1.0)), {}, "flow"),
        (LARGE, LARGE_PAIR, "xfeat"),
    ],
)
def test_auto_chooses_by_the_motion_and_says_so(features, caplog, motion, options, choice):
    loaded = []

    def load() -> XFeatMatcher:
        loaded.append(True)
        return XFeatMatcher(features=features)

    matcher = AutoMatcher(load_large_motion=load)
    with caplog.at_level(logging.DEBUG, logger="animator.match.auto"):
        flow = matcher.flow(*moved_pair(motion, seed=5, **options))
    assert flow.matcher == choice
    assert f"auto: {choice}" in caplog.text
    assert bool(loaded) == (choice == "xfeat")


def _squeezed(seed: int, squeeze: float) -> MaskedImage:
    """A textured disk as seen from the side, narrower and narrower."""
    here = centers()
    center = SIDE_PX / 2
    origin = (here - center) * np.array([1 / squeeze, 1.0]) + center
    return image_of(Texture(seed)(origin), disk((center, center), 90)(origin))


def test_the_view_nearest_to_the_frame_ranks_first(features):
    views = [_squeezed(9, 1.0), _squeezed(8, 0.6), _squeezed(8, 0.88)]
    ranking = rank_views(views, _squeezed(8, 0.92), features=features, shortlist_count=2)
    assert [view.index for view in ranking] == [2, 1, 0]
    assert [view.matches is None for view in ranking] == [False, False, True]
    assert ranking[0].cell_count > ranking[1].cell_count > ranking[2].cell_count


def test_equal_views_keep_their_order_and_empty_ones_come_last(features):
    view = _squeezed(8, 1.0)
    empty = MaskedImage(rgb=view.rgb, mask=np.zeros_like(view.mask))
    ranking = rank_views([empty, view, view], view, features=features, shortlist_count=2)
    assert [(view.index, view.cell_count > 0) for view in ranking] == [
        (1, True),
        (2, True),
        (0, False),
    ]


def test_cells_are_counted_once():
    mask = np.zeros((100, 200), bool)
    mask[10:42, 20:84] = True  # 64 px wide: cells of 2 px
    frame = MaskedImage(rgb=np.zeros((100, 200, 3), np.uint8), mask=mask)
    target = np.array([[20.1, 10.1], [21.9, 11.9], [22.1, 10.1], [80.0, 40.0]], np.float32)
    matches = Matches(source_px=target, target_px=target, confidences=np.ones(4, np.float32))
    assert occupied_cells(matches, frame) == 3
