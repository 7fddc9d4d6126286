"""Quaternion arithmetic on numpy arrays, `wxyz`, broadcasting over leading axes."""

import numpy as np


def multiply(left_wxyz: np.ndarray, right_wxyz: np.ndarray) -> np.ndarray:
    """Return the Hamilton product `left * right`: first `right` rotates, then `left`. Shape (..., 4)."""
    w1, x1, y1, z1 = np.moveaxis(left_wxyz, -1, 0)
    w2, x2, y2, z2 = np.moveaxis(right_wxyz, -1, 0)
    return np.stack(
        [
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ],
        axis=-1,
    )


def normalize(quats_wxyz: np.ndarray) -> np.ndarray:
    """Return unit quaternions; a zero quaternion becomes the identity. Shape (..., 4)."""
    norms = np.linalg.norm(quats_wxyz, axis=-1, keepdims=True)
    identity = np.array([1.0, 0.0, 0.0, 0.0], dtype=quats_wxyz.dtype)
    return np.where(norms > 1e-12, quats_wxyz / np.maximum(norms, 1e-12), identity)


def to_matrices(quats_wxyz: np.ndarray) -> np.ndarray:
    """Return the rotation matrices of unit quaternions, for column vectors. Shape (..., 3, 3)."""
    w, x, y, z = np.moveaxis(quats_wxyz, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def slerp(start_wxyz: np.ndarray, end_wxyz: np.ndarray, share: float) -> np.ndarray:
    """Interpolate along the shorter arc, as UsdSkel and glTF LINEAR do (glTF 2.0, appendix C.4). Shape (..., 4)."""
    cosines = np.sum(start_wxyz * end_wxyz, axis=-1, keepdims=True)
    end_wxyz = np.where(cosines < 0, -end_wxyz, end_wxyz)
    angles = np.arccos(np.clip(np.abs(cosines), 0.0, 1.0))
    sines = np.sin(angles)
    nearly_equal = sines < 1e-6
    safe = np.where(nearly_equal, 1.0, sines)
    first = np.where(nearly_equal, 1.0 - share, np.sin((1.0 - share) * angles) / safe)
    second = np.where(nearly_equal, share, np.sin(share * angles) / safe)
    return normalize(first * start_wxyz + second * end_wxyz)
