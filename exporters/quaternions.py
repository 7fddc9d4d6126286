"""Quaternion arithmetic on numpy arrays, `wxyz`, broadcasting over leading axes."""

import numpy as np


def multiply(left_wxyz: np.ndarray, right_wxyz: np.ndarray) -> np.ndarray:
    """Return `left * right` (Hamilton): first `right` rotates, then `left`. Shape (..., 4)."""
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
    norms = np.sqrt(np.einsum("...i,...i->...", quats_wxyz, quats_wxyz))[..., None]
    if norms.min(initial=1.0) > 1e-12:
        return quats_wxyz / norms
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


def slerp(start_wxyz: np.ndarray, end_wxyz: np.ndarray, share: float | np.ndarray) -> np.ndarray:
    """Interpolate along the shorter arc, as UsdSkel and glTF LINEAR do. Shape (..., 4).

    The share is one number, or has shape (..., 1).

    Reference: glTF 2.0 specification, appendix C.4.
    """
    cosines = np.sum(start_wxyz * end_wxyz, axis=-1, keepdims=True)
    end_wxyz = np.where(cosines < 0, -end_wxyz, end_wxyz)
    angles = np.arccos(np.clip(np.abs(cosines), 0.0, 1.0))
    sines = np.sin(angles)
    nearly_equal = sines < 1e-6
    safe = np.where(nearly_equal, 1.0, sines)
    first = np.where(nearly_equal, 1.0 - share, np.sin((1.0 - share) * angles) / safe)
    second = np.where(nearly_equal, share, np.sin(share * angles) / safe)
    return normalize(first * start_wxyz + second * end_wxyz)


def conjugate(quats_wxyz: np.ndarray) -> np.ndarray:
    """Return the inverse rotations of unit quaternions. Shape (..., 4)."""
    return quats_wxyz * np.array([1, -1, -1, -1], dtype=quats_wxyz.dtype)


def from_matrices(rotations: np.ndarray) -> np.ndarray:
    """Return unit quaternions of rotation matrices for column vectors, real part >= 0.

    Of the four rows of `4 q q^T` the one with the largest diagonal is the best conditioned
    (Shepperd 1978, "Quaternion from rotation matrix").

    Args:
        rotations: Proper rotations, shape (..., 3, 3).

    Returns:
        Quaternions, shape (..., 4).
    """
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = (
        np.moveaxis(row, -1, 0) for row in np.moveaxis(rotations, -2, 0)
    )
    rows = [
        [1 + m00 + m11 + m22, m21 - m12, m02 - m20, m10 - m01],
        [m21 - m12, 1 + m00 - m11 - m22, m10 + m01, m02 + m20],
        [m02 - m20, m10 + m01, 1 - m00 + m11 - m22, m21 + m12],
        [m10 - m01, m02 + m20, m21 + m12, 1 - m00 - m11 + m22],
    ]
    outer = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    best = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    quats_wxyz = np.take_along_axis(outer, best[..., None, None], axis=-2)[..., 0, :]
    quats_wxyz = np.where(quats_wxyz[..., :1] < 0, -quats_wxyz, quats_wxyz)
    return normalize(quats_wxyz)
