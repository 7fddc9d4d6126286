"""Reading images at positions, and cropping without moving anything."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.match.local_normalization import normalize_locally
from animator.match.protocol import FlowField, MaskedImage
from animator.match.sampling import inside_mask, pixel_centers, warp
from animator.match.window import window_around


def _ramp(height: int, width: int) -> np.ndarray:
    """An image whose value is its own position."""
    rows, columns = np.mgrid[0:height, 0:width]
    return np.stack([columns + 0.5, rows + 0.5], axis=-1).astype(np.float32)


def test_warping_a_ramp_adds_the_flow():
    flow = np.full((20, 30, 2), (1.25, -0.5), np.float32)
    warped = warp(_ramp(20, 30), flow)
    inner = (slice(1, -2), slice(1, -2))
    np.testing.assert_allclose(warped[inner], (_ramp(20, 30) + flow)[inner], atol=1e-4)
    np.testing.assert_array_equal(pixel_centers(20, 30), _ramp(20, 30))


def test_a_pixel_owns_the_square_around_its_center():
    mask = np.zeros((4, 6), bool)
    mask[1, 2] = True
    points = np.array(
        [[2.0, 1.0], [2.99, 1.99], [3.0, 1.5], [1.99, 1.5], [-0.1, 1.5], [np.nan, 1], [np.inf, 1]]
    )
    np.testing.assert_array_equal(
        inside_mask(mask, points), [True, True, False, False, False, False, False]
    )


@settings(derandomize=True, max_examples=25, deadline=None)
@given(
    left=st.integers(0, 600),
    top=st.integers(0, 300),
    width=st.integers(1, 1500),
    height=st.integers(1, 800),
)
def test_windows_map_positions_back_and_forth(left, top, width, height):
    mask = np.zeros((1200, 2200), bool)
    mask[top : top + height, left : left + width] = True
    image = MaskedImage(rgb=np.zeros((*mask.shape, 3), np.uint8), mask=mask)
    assert image.box_px == (left, top, left + width, top + height)
    window = window_around(image)
    assert window is not None
    cut = window.cut(image)
    assert cut.mask.shape[0] % 32 == 0 and cut.mask.shape[1] % 32 == 0
    assert max(cut.mask.shape) <= 1024
    points = np.array([[left, top], [left + width, top + height]], float)
    work = window.to_work(points)
    np.testing.assert_allclose(window.to_image(work), points, atol=1e-9)
    # The object's box in the crop, seen by its mask, agrees with the mapping of its corners.
    if min(width, height) > 8:
        np.testing.assert_allclose(np.reshape(cut.box_px, (2, 2)), work, atol=1.01)


def test_a_pasted_flow_is_in_pixels_of_the_whole_image():
    mask = np.zeros((1500, 2500), bool)
    mask[100:1400, 200:2300] = True
    image = MaskedImage(rgb=np.zeros((*mask.shape, 3), np.uint8), mask=mask)
    everywhere = MaskedImage(rgb=image.rgb, mask=np.ones_like(mask))
    window = window_around(image)
    shape = window.cut(image).mask.shape
    flow = FlowField(
        flow_px=np.full((*shape, 2), (3.0, -1.0), np.float32),
        confidences=np.full(shape, 0.5, np.float32),
    )
    pasted = window.paste(flow, image, everywhere)
    expected = np.array([3.0, -1.0]) / window.scale
    np.testing.assert_allclose(pasted.flow_px[700, 1000], expected, rtol=1e-5)
    np.testing.assert_array_equal(pasted.confidences > 0, mask)


def test_local_normalization_undoes_gain_and_offset():
    rng = np.random.default_rng(1)
    coarse = rng.integers(60, 160, (16, 16), np.uint8)
    gray = np.kron(coarse, np.ones((6, 6), np.uint8))
    mask = np.ones(gray.shape, bool)
    mask[:, :20] = False

    def normalized(values):
        rgb = np.repeat(values[..., None], 3, axis=-1)
        return normalize_locally(MaskedImage(rgb=rgb, mask=mask)).astype(int)

    plain = normalized(gray)
    brighter = normalized((gray * 1.3 + 20).astype(np.uint8))
    assert np.abs(plain - brighter)[mask].max() <= 12  # raw values differ by 38 to 68
    assert (plain[~mask] == 128).all()
    # Nothing beyond the mask is seen: a change there changes nothing here.
    spoiled = gray.copy()
    spoiled[~mask] = 255
    np.testing.assert_array_equal(normalized(spoiled), plain)
