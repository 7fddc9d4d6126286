"""Claims of unexplained pixels on unexplained Gaussians, on hand-made pictures."""

import dataclasses

import numpy as np
import pytest

from animator.match.claims import ClaimConfig, CoveredImage, DrawnGaussians, find_claims

SIZE_PX = 100
BODY, LIMB, NEW_PLACE = slice(40, 60), slice(44, 56), slice(64, 74)
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
CONFIG = ClaimConfig(reach=0.4)


def picture(*patches: tuple[slice, tuple[float, float, float]]) -> CoveredImage:
    """A square picture with patches of color, each over the columns given and rows 40 to 60."""
    rgb, alpha = np.zeros((SIZE_PX, SIZE_PX, 3)), np.zeros((SIZE_PX, SIZE_PX))
    for columns, color in patches:
        rgb[BODY, columns] = color
        alpha[BODY, columns] = 1.0
    return CoveredImage(rgb=rgb, alpha=alpha)


def gaussians(columns: slice, color: tuple[float, float, float], share: float) -> DrawnGaussians:
    x, y = np.meshgrid(np.arange(columns.start, columns.stop) + 0.5, np.arange(40, 60) + 0.5)
    count = x.size
    return DrawnGaussians(
        centers_px=np.stack([x.ravel(), y.ravel()], axis=1),
        depths=np.ones(count),
        visible_shares=np.full(count, share),
        opacities=np.ones(count),
        colors=np.tile(color, (count, 1)),
    )


def together(*parts: DrawnGaussians) -> DrawnGaussians:
    fields = [field.name for field in dataclasses.fields(DrawnGaussians)]
    return DrawnGaussians(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in fields}
    )


BODY_AND_HIDDEN_LIMB = together(gaussians(BODY, RED, 1.0), gaussians(LIMB, BLUE, 0.0))
LIMB_IDS = np.arange(20 * 20, len(BODY_AND_HIDDEN_LIMB.depths))


def claims(render, frame, drawn, config=CONFIG):
    return find_claims(render, frame, drawn, 60.0, config, np.random.default_rng(0))


def test_a_limb_that_comes_out_claims_the_hidden_limb_and_not_the_body():
    found = claims(
        picture((BODY, RED)), picture((BODY, RED), (NEW_PLACE, BLUE)), BODY_AND_HIDDEN_LIMB
    )
    assert found is not None
    assert np.isin(found.gaussian_ids, LIMB_IDS).all()
    assert len(np.unique(found.gaussian_ids)) == len(found)
    assert (found.target_px[:, 0] > NEW_PLACE.start).all()
    assert (found.target_px[:, 0] < NEW_PLACE.stop).all()
    assert found.confidences.max() == 1.0
    assert (found.confidences > 0).all()


def test_gaussians_drawn_where_the_frame_shows_nothing_are_claimed():
    lost = together(gaussians(BODY, RED, 1.0), gaussians(slice(80, 86), BLUE, 1.0))
    found = claims(
        picture((BODY, RED), (slice(80, 86), BLUE)),
        picture((BODY, RED), (NEW_PLACE, BLUE)),
        lost,
    )
    assert found is not None
    assert (lost.centers_px[found.gaussian_ids, 0] > 80).all()


def test_a_frame_that_is_explained_claims_nothing():
    same = picture((BODY, RED))
    assert claims(same, same, BODY_AND_HIDDEN_LIMB) is None


def test_nothing_is_claimed_when_every_gaussian_is_needed():
    drawn = gaussians(BODY, RED, 1.0)
    assert claims(picture((BODY, RED)), picture((BODY, RED), (NEW_PLACE, BLUE)), drawn) is None


@pytest.mark.parametrize("config", [ClaimConfig(reach=0.05), ClaimConfig(min_area=0.5)])
def test_nothing_is_claimed_out_of_reach_or_for_a_speck(config):
    frame = picture((BODY, RED), (NEW_PLACE, BLUE))
    assert claims(picture((BODY, RED)), frame, BODY_AND_HIDDEN_LIMB, config) is None


def test_faint_gaussians_and_those_behind_the_camera_are_not_claimed():
    frame = picture((BODY, RED), (NEW_PLACE, BLUE))
    faint = dataclasses.replace(BODY_AND_HIDDEN_LIMB, opacities=np.full(640, 0.05))
    assert claims(picture((BODY, RED)), frame, faint) is None


def test_many_pixels_are_thinned_by_the_generator_alone():
    config = dataclasses.replace(CONFIG, max_pixels=50)
    frame = picture((BODY, RED), (NEW_PLACE, BLUE))
    first, second = (
        claims(picture((BODY, RED)), frame, BODY_AND_HIDDEN_LIMB, config) for _ in range(2)
    )
    assert first is not None and second is not None
    assert len(first) <= 50
    np.testing.assert_array_equal(first.gaussian_ids, second.gaussian_ids)
