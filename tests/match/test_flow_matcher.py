"""The optical-flow matcher against motions known exactly."""

import numpy as np
import pytest
from textured_pairs import Affine, Texture, centers, disk, flow_errors, image_of, moved_pair

from animator.match.flow import FlowMatcher
from animator.match.protocol import MaskedImage

MATCHER = FlowMatcher()


@pytest.mark.parametrize(
    "motion",
    [
        Affine(shift_px=(3.25, -1.5)),
        Affine(angle_deg=4.0),
        Affine(angle_deg=-2.0, scale=1.04, shift_px=(2.0, 1.0)),
    ],
)
def test_small_motion_is_found_to_a_fraction_of_a_pixel(motion):
    source, target = moved_pair(motion)
    flow = MATCHER.flow(source, target)
    errors = flow_errors(flow, motion)
    assert np.median(errors) < 0.15
    assert np.percentile(errors, 90) < 0.5
    assert flow.trusted_share(source.mask) > 0.85


def test_matches_are_positions_with_pixel_centers_at_one_half():
    motion = Affine(shift_px=(2.5, 0.75))
    matches = MATCHER.match(*moved_pair(motion))
    # Grid pixels 2, 6, 10, ... have their centers at 2.5, 6.5, 10.5, ...
    np.testing.assert_array_equal(matches.source_px % 4, 2.5)
    np.testing.assert_allclose(
        np.median(matches.target_px - matches.source_px, axis=0), (2.5, 0.75), atol=0.05
    )
    assert matches.source_px.dtype == matches.target_px.dtype == np.float32


def test_nothing_outside_either_mask_is_trusted():
    motion = Affine(shift_px=(4.0, 0.0))
    source, target = moved_pair(motion)
    half = target.mask & (centers()[..., 0] < 140)
    flow = MATCHER.flow(source, MaskedImage(rgb=target.rgb, mask=half))
    assert not flow.confidences[~source.mask].any()
    landing_x = (centers() + flow.flow_px)[..., 0]
    assert flow.confidences.any()
    assert landing_x[flow.confidences > 0].max() < 140


def test_what_lies_outside_the_masks_has_no_influence():
    source, target = moved_pair(Affine(shift_px=(2.0, 2.0)))
    noise = np.random.default_rng(0).integers(0, 256, source.rgb.shape, np.uint8)
    other = MATCHER.flow(
        MaskedImage(rgb=np.where(source.mask[..., None], source.rgb, noise), mask=source.mask),
        MaskedImage(rgb=np.where(target.mask[..., None], target.rgb, noise), mask=target.mask),
    )
    flow = MATCHER.flow(source, target)
    np.testing.assert_array_equal(flow.flow_px, other.flow_px)
    np.testing.assert_array_equal(flow.confidences, other.confidences)


def test_pixels_that_get_covered_are_not_trusted():
    back, front = Texture(1), Texture(2)
    here = centers()
    is_back = disk((128, 128), 90)(here)
    front_before, front_after = disk((90, 128), 30)(here), disk((104, 128), 30)(here)
    still = back(here)
    source = image_of(np.where(front_before[..., None], front(here), still), is_back)
    moved = front(here - np.array([14.0, 0.0]))
    target = image_of(np.where(front_after[..., None], moved, still), is_back)
    flow = MATCHER.flow(source, target)

    covered = is_back & front_after & ~front_before
    clear = is_back & ~disk((97, 128), 55)(here) & disk((128, 128), 82)(here)
    assert (flow.confidences[covered] > 0).mean() < 0.35
    assert (flow.confidences[clear] > 0).mean() > 0.95
    # Without the round trip, nearly all covered pixels would have been believed or blurred along.
    assert np.median(np.linalg.norm(flow.flow_px[clear], axis=-1)) < 0.1


def test_unlike_textures_are_not_matched():
    here = centers()
    mask = disk((128, 128), 80)(here)
    flow = MATCHER.flow(image_of(Texture(3)(here), mask), image_of(Texture(4)(here), mask))
    assert flow.trusted_share(mask) < 0.2  # smooth patches do look alike here and there


def test_an_empty_mask_gives_no_matches():
    source, target = moved_pair(Affine())
    empty = MaskedImage(rgb=target.rgb, mask=np.zeros_like(target.mask))
    assert len(MATCHER.match(source, empty)) == 0
    assert len(MATCHER.match(empty, target)) == 0


def test_images_of_two_sizes_are_refused():
    source, target = moved_pair(Affine())
    smaller = MaskedImage(rgb=target.rgb[:-1], mask=target.mask[:-1])
    with pytest.raises(ValueError, match=r"one size.*\(255, 256\), \(256, 256\)"):
        MATCHER.flow(source, smaller)


def test_the_same_pair_gives_the_same_bytes():
    pair = moved_pair(Affine(angle_deg=3.0))
    first, second = MATCHER.flow(*pair), MATCHER.flow(*pair)
    assert first.flow_px.tobytes() == second.flow_px.tobytes()
    assert first.confidences.tobytes() == second.confidences.tobytes()


@pytest.mark.parametrize("enlargement", [0.3, 4.5])
def test_small_and_large_images_are_matched_at_a_working_size(enlargement):
    import cv2

    motion = Affine(shift_px=(4.0, 2.0))
    side = round(256 * enlargement)

    def resize(image):
        rgb = cv2.resize(image.rgb, (side, side), interpolation=cv2.INTER_AREA)
        mask = cv2.resize(
            image.mask.astype(np.uint8), (side, side), interpolation=cv2.INTER_NEAREST
        )
        return MaskedImage(rgb=rgb, mask=mask > 0)

    matches = MATCHER.match(*map(resize, moved_pair(motion)))
    moved = np.median(matches.target_px - matches.source_px, axis=0)
    np.testing.assert_allclose(moved, np.array([4.0, 2.0]) * side / 256, atol=0.1 * enlargement)
