"""Reading images at fractional positions, and the one place where +0.5 meets OpenCV's centres."""

import numpy as np

OPENCV_FROM_PIXEL = -0.5  # OpenCV puts the centre of the first pixel at 0, this project at 0.5

_ROW_LENGTH = 4096  # cv2.remap refuses maps with a side of 32767 or more, so point lists are folded


def pixel_centers(height_px: int, width_px: int) -> np.ndarray:
    """Return the centre of every pixel as (x, y), float32, shape (H, W, 2)."""
    xs = np.arange(width_px, dtype=np.float32) + 0.5
    ys = np.arange(height_px, dtype=np.float32) + 0.5
    return np.stack(np.meshgrid(xs, ys), axis=-1)


def sample(image: np.ndarray, points_px: np.ndarray) -> np.ndarray:
    """Read an image bilinearly; positions outside take the nearest border pixel.

    Args:
        image: uint8 or float32, shape (H, W) or (H, W, C) with C <= 4.
        points_px: Positions, pixel centres at +0.5, finite, shape (M, 2).

    Returns:
        The values, in the image's dtype, shape (M,) or (M, C).
    """
    import cv2

    count = len(points_px)
    if count == 0:
        return np.zeros((0, *image.shape[2:]), image.dtype)
    row_count = -(-count // _ROW_LENGTH)
    folded = np.zeros((row_count * _ROW_LENGTH, 2), np.float32)
    folded[:count] = points_px + OPENCV_FROM_PIXEL
    columns, rows = folded.reshape(row_count, _ROW_LENGTH, 2).transpose(2, 0, 1)
    values = cv2.remap(
        image,
        np.ascontiguousarray(columns),
        np.ascontiguousarray(rows),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return values.reshape(row_count * _ROW_LENGTH, *image.shape[2:])[:count]


def warp(image: np.ndarray, flow_px: np.ndarray) -> np.ndarray:
    """Pull an image back along a flow: `warp(target, flow)` lines up with the source.

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
    height, width = mask.shape
    points = np.asarray(points_px, np.float64).reshape(-1, 2)
    # Comparisons with NaN are false, so points that are not finite are outside.
    in_image = ((points >= 0) & (points < (width, height))).all(axis=1)
    inside = np.zeros(len(points), bool)
    columns, rows = points[in_image].astype(np.int64).T
    inside[in_image] = mask[rows, columns]
    return inside
