"""Reading images where a flow points: the one place where +0.5 meets OpenCV's pixel centres."""

from typing import Any

import numpy as np

OPENCV_FROM_PIXEL = -0.5  # OpenCV puts the centre of the first pixel at 0, this project at 0.5


def pixel_centers(height_px: int, width_px: int) -> np.ndarray:
    """Return the centre of every pixel as (x, y), float32, shape (H, W, 2)."""
    xs = np.arange(width_px, dtype=np.float32) + 0.5
    ys = np.arange(height_px, dtype=np.float32) + 0.5
    return np.stack(np.meshgrid(xs, ys), axis=-1)


def warp(image: np.ndarray, flow_px: np.ndarray) -> np.ndarray:
    """Pull an image back along a flow: `warp(target, flow)` lines up with the source.

    OpenCV rounds positions to 1/32 px, and positions outside take the nearest border pixel.

    Args:
        image: What to read, shape (H, W) or (H, W, C).
        flow_px: Displacement of each source pixel [px], float32, shape (H, W, 2).

    Returns:
        `image` at every source pixel plus its displacement, same shape as `image`.
    """
    import cv2

    landing = pixel_centers(*flow_px.shape[:2]) + OPENCV_FROM_PIXEL + flow_px
    return cv2.remap(
        image,
        np.ascontiguousarray(landing[..., 0], np.float32),
        np.ascontiguousarray(landing[..., 1], np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )


def inside_mask(mask: np.ndarray, points_px: np.ndarray) -> np.ndarray:
    """Tell which positions lie in a pixel of the mask; outside the image is outside the mask.

    Args:
        mask: Bool, shape (H, W).
        points_px: Positions, pixel centres at +0.5, shape (M, 2); non-finite ones are outside.

    Returns:
        Bool, shape (M,).
    """
    return values_at(mask, points_px, outside=False)


def values_at(image: np.ndarray, points_px: np.ndarray, *, outside: Any) -> np.ndarray:
    """Read the pixels that some positions lie in.

    Args:
        image: One value a pixel, shape (H, W).
        points_px: Positions, pixel centres at +0.5, shape (M, 2); non-finite ones are outside.
        outside: The value of what lies outside the image.

    Returns:
        The values, of the image's type, shape (M,).
    """
    height, width = image.shape
    points = np.asarray(points_px, np.float64).reshape(-1, 2)
    # Comparisons with NaN are false, so points that are not finite are outside.
    in_image = ((points >= 0) & (points < (width, height))).all(axis=1)
    values = np.full(len(points), outside, image.dtype)
    columns, rows = points[in_image].astype(np.int64).T
    values[in_image] = image[rows, columns]
    return values
