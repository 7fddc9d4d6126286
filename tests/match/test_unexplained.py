"""What a render does not explain, on hand-made pictures."""

import numpy as np
import pytest

from animator.match.unexplained import (
    CoveredImage,
    Piece,
    largest_unexplained_piece,
    unexplained_pixels,
)

BODY = (slice(20, 80), slice(20, 60))
LEG = (slice(40, 60), slice(70, 80))
EDGE = (slice(20, 80), slice(60, 63))


def picture(*patches: tuple[slice, slice]) -> CoveredImage:
    """White patches in a square picture."""
    alpha = np.zeros((100, 100), np.float32)
    for patch in patches:
        alpha[patch] = 1.0
    return CoveredImage(rgb=np.repeat(alpha[..., None], 3, axis=-1), alpha=alpha)


def piece(render: CoveredImage, frame: CoveredImage) -> Piece | None:
    return largest_unexplained_piece(render, frame, error=0.25, thinnest_px=6.0)


@pytest.mark.parametrize(
    ("drawn", "shown", "missing"),
    [
        ((BODY, LEG), (BODY, LEG), ()),
        ((BODY,), (BODY, LEG), LEG),
        ((BODY, LEG), (BODY,), ()),
        ((BODY,), (BODY, EDGE), ()),
        ((), (), ()),
    ],
    ids=["all explained", "a leg is missing", "a leg too much", "a thin edge", "nothing there"],
)
def test_a_piece_is_a_thick_part_of_the_object_that_is_not_drawn(drawn, shown, missing):
    frame = picture(*shown)
    found = piece(picture(*drawn), frame)
    if not missing:
        assert found is None
        return
    assert found is not None
    assert found.share == pytest.approx(frame.alpha[missing].sum() / frame.alpha.sum(), rel=0.15)
    rows, columns = missing
    middle_px = [(columns.start + columns.stop) / 2, (rows.start + rows.stop) / 2]
    np.testing.assert_allclose(found.middle_px, middle_px, atol=1.5)


def test_the_largest_of_two_pieces_counts():
    small = (slice(5, 15), slice(5, 15))
    frame = picture(BODY, LEG, small)
    found, alone = piece(picture(BODY), frame), piece(picture(BODY, small), frame)
    assert found is not None
    assert alone is not None
    assert found.share == alone.share


def test_another_color_is_as_unexplained_as_another_coverage():
    frame, same = picture(BODY), picture(BODY)
    gray = CoveredImage(rgb=0.5 * frame.rgb, alpha=frame.alpha)
    assert unexplained_pixels(gray, frame, error=0.25)[50, 40]
    assert not unexplained_pixels(same, frame, error=0.25).any()
