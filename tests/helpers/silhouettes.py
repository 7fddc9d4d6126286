"""Triangle meshes as seen by a pinhole camera: a plain rasterizer to compare silhouettes with."""

import numpy as np


def covered(
    positions: np.ndarray,
    triangles: np.ndarray,
    *,
    cam_from_world: np.ndarray,
    intrinsics: np.ndarray,
    width_px: int,
    height_px: int,
) -> np.ndarray:
    """Return which pixels have a triangle at their center (+0.5), bool, shape (H, W).

    Args:
        positions: Vertices before the camera, shape (V, 3).
        triangles: Vertex indices, shape (F, 3).
        cam_from_world: World to camera, OpenCV axes, shape (4, 4).
        intrinsics: Pinhole matrix [px], shape (3, 3).
        width_px: Image width.
        height_px: Image height.
    """
    in_camera = positions @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    assert (in_camera[:, 2] > 0).all()
    projected = in_camera @ intrinsics.T
    corners = (projected[:, :2] / projected[:, 2:])[triangles]
    image = np.zeros((height_px, width_px), bool)
    first = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, [width_px, height_px]).astype(int)
    last = np.clip(np.floor(corners.max(axis=1) - 0.5), -1, [width_px - 1, height_px - 1])
    for (a, b, c), (x0, y0), (x1, y1) in zip(corners, first, last.astype(int), strict=True):
        y, x = np.mgrid[y0 : y1 + 1, x0 : x1 + 1] + 0.5
        sides = [
            (end[0] - start[0]) * (y - start[1]) - (end[1] - start[1]) * (x - start[0])
            for start, end in ((a, b), (b, c), (c, a))
        ]
        inside = np.minimum.reduce(sides) * np.maximum.reduce(sides) >= 0
        image[y0 : y1 + 1, x0 : x1 + 1] |= inside
    return image


def intersection_over_union(first: np.ndarray, second: np.ndarray) -> float:
    """Return how far two masks agree, 0..1."""
    return float(np.sum(first & second) / np.sum(first | second))
