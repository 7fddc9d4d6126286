"""Real spherical harmonics as Gaussian splatting uses them, and their rotation."""

import math

import numpy as np

MAX_DEGREE = 3

_C1 = math.sqrt(3 / (4 * math.pi))
_C2 = math.sqrt(15 / (4 * math.pi))
_C3 = math.sqrt(35 / (32 * math.pi))


def basis(directions: np.ndarray) -> np.ndarray:
    """Evaluate the 16 basis functions up to degree 3.

    Order l = 0..3, m = -l..l within, with the Condon-Shortley sign of the reference renderer
    (Kerbl et al. 2023, `computeColorFromSH`; the same in glTF and USD).

    Args:
        directions: Unit vectors, shape (M, 3).

    Returns:
        Values, shape (M, 16).
    """
    x, y, z = directions.T
    xx, yy, zz = x * x, y * y, z * z
    return np.stack(
        [
            np.full_like(x, math.sqrt(1 / (4 * math.pi))),
            -_C1 * y,
            _C1 * z,
            -_C1 * x,
            _C2 * x * y,
            -_C2 * y * z,
            _C2 / math.sqrt(12) * (2 * zz - xx - yy),
            -_C2 * x * z,
            _C2 / 2 * (xx - yy),
            -_C3 * y * (3 * xx - yy),
            _C3 * math.sqrt(24) * x * y * z,
            -_C3 * math.sqrt(3 / 5) * y * (4 * zz - xx - yy),
            _C3 * math.sqrt(2 / 5) * z * (2 * zz - 3 * xx - 3 * yy),
            -_C3 * math.sqrt(3 / 5) * x * (4 * zz - xx - yy),
            _C3 * math.sqrt(6) * z * (xx - yy),
            -_C3 * x * (xx - 3 * yy),
        ],
        axis=-1,
    )


def rotate(sh_coeffs: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the coefficients of the same color pattern after turning it.

    Each degree spans a space closed under rotation, so the turned pattern sampled in more
    directions than there are functions determines its coefficients exactly.

    Args:
        sh_coeffs: Coefficients, shape (N, K, 3), K in {1, 4, 9, 16}.
        rotation: New from old directions, proper rotation, shape (3, 3).

    Returns:
        Coefficients of the same shape and type.
    """
    count = sh_coeffs.shape[1]
    directions = _spread_directions(4 * (MAX_DEGREE + 1) ** 2)
    values_old = basis(directions @ rotation)[:, :count]  # rows: rotation^T applied to a direction
    turn = np.linalg.lstsq(basis(directions)[:, :count], values_old, rcond=None)[0]
    return np.einsum("ij,njc->nic", turn, sh_coeffs, optimize=True).astype(sh_coeffs.dtype)


def _spread_directions(count: int) -> np.ndarray:
    """Spread directions evenly over the sphere on a Fibonacci spiral, shape (count, 3)."""
    heights = 1 - (2 * np.arange(count) + 1) / count
    angles_rad = np.pi * (3 - math.sqrt(5)) * np.arange(count)
    radii = np.sqrt(1 - heights**2)
    return np.stack([radii * np.cos(angles_rad), radii * np.sin(angles_rad), heights], axis=-1)
