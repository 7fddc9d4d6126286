"""Real spherical harmonics as Gaussian splatting uses them, and their rotation."""

import functools
import math

import numpy as np

MAX_DEGREE = 3

BLOCK_ROWS = 2048
"""Patterns turned at a time: their 48 numbers each stay in the processor's cache."""

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
    turn = _turn_matrix(rotation)[: sh_coeffs.shape[1], : sh_coeffs.shape[1]]
    return np.einsum("ij,njc->nic", turn, sh_coeffs, optimize=True).astype(sh_coeffs.dtype)


def rotate_each(sh_coeffs: np.ndarray, quats_wxyz: np.ndarray) -> np.ndarray:
    """Turn each color pattern by a rotation of its own.

    A turn about z mixes only the coefficients m and -m, as the angle m times as large; a quarter
    turn about x takes z to y. So the Wigner matrix of `Rz(a) Ry(b) Rz(c)` is that of
    `Rz(a) Rx(-90) Rz(b) Rx(90) Rz(c)`: three such mixtures and two constant matrices (Kautz, Sloan
    and Snyder 2002, "Fast, arbitrary BRDF shading for low-frequency lighting using spherical
    harmonics").

    Args:
        sh_coeffs: Coefficients, float32, shape (N, K, 3), K in {1, 4, 9, 16}.
        quats_wxyz: New from old directions, unit, shape (N, 4).

    Returns:
        Coefficients, float32, shape (N, K, 3).
    """
    turned = sh_coeffs.copy()
    degrees = [slice(n * n, (n + 1) * (n + 1)) for n in range(1, math.isqrt(sh_coeffs.shape[1]))]
    for first in range(0, len(sh_coeffs), BLOCK_ROWS):
        rows = slice(first, first + BLOCK_ROWS)
        start, middle, end = _zyz_turns(quats_wxyz[rows])
        for degree, orders in enumerate(degrees, start=1):
            about_x, back = _quarter_turns(degree)
            pattern = sh_coeffs[rows, orders].transpose(1, 2, 0).copy()
            _mix_orders(pattern, start)
            pattern = (about_x @ pattern.reshape(len(pattern), -1)).reshape(pattern.shape)
            _mix_orders(pattern, middle)
            pattern = (back @ pattern.reshape(len(pattern), -1)).reshape(pattern.shape)
            _mix_orders(pattern, end)
            turned[rows, orders] = pattern.transpose(2, 0, 1)
    return turned


_Turn = list[tuple[np.ndarray, np.ndarray]]
"""Cosines and sines of one, two and three times an angle about z, shape (N,) each."""


def _zyz_turns(quats_wxyz: np.ndarray) -> tuple[_Turn, _Turn, _Turn]:
    """Split rotations into turns about z, y and z again, in the order they are applied.

    With half angles `w + iz = cos(b) exp(i(a + c))` and `y - ix = sin(b) exp(i(a - c))`; where one
    of them is zero, any phase serves.
    """
    w, x, y, z = np.ascontiguousarray(quats_wxyz.T, dtype=np.float32)
    cos_b, sum_cos, sum_sin = _polar(w, z)
    sin_b, gap_cos, gap_sin = _polar(y, -x)
    first = _multiples(sum_cos * gap_cos + sum_sin * gap_sin, sum_sin * gap_cos - sum_cos * gap_sin)
    last = _multiples(sum_cos * gap_cos - sum_sin * gap_sin, sum_sin * gap_cos + sum_cos * gap_sin)
    return first, _multiples(cos_b * cos_b - sin_b * sin_b, 2 * cos_b * sin_b), last


def _polar(real: np.ndarray, imaginary: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the radius of complex numbers, and cosine and sine of their angle; 1 and 0 for none."""
    radii = np.sqrt(real * real + imaginary * imaginary)
    is_zero = radii == 0
    safe = radii + is_zero
    return radii, real / safe + is_zero, imaginary / safe


def _multiples(cosines: np.ndarray, sines: np.ndarray) -> _Turn:
    """Return cosine and sine of one, two, three times the angles, by the addition theorem."""
    multiples = [(cosines, sines)]
    for _ in range(MAX_DEGREE - 1):
        c, s = multiples[-1]
        multiples.append((c * cosines - s * sines, s * cosines + c * sines))
    return multiples


def _mix_orders(pattern: np.ndarray, turn: _Turn) -> None:
    """Turn coefficients of one degree, shape (2l+1, 3, N), about z, in place.

    The functions m and -m are cosine and sine of m times the longitude, with the same sign.
    """
    degree = len(pattern) // 2
    for m in range(1, degree + 1):
        cosines, sines = turn[m - 1]
        of_sine, of_cosine = pattern[degree - m], pattern[degree + m]
        mixed = of_sine * cosines + of_cosine * sines
        of_cosine *= cosines
        of_cosine -= of_sine * sines
        of_sine[:] = mixed


@functools.cache
def _quarter_turns(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what turns one degree by +90 and by -90 degrees about x, float32, (2l+1, 2l+1)."""
    orders = slice(degree * degree, (degree + 1) * (degree + 1))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    forth = _turn_matrix(about_x)[orders, orders].astype(np.float32)
    return forth, np.ascontiguousarray(forth.T)  # orthogonal, so the transpose turns back


def _turn_matrix(rotation: np.ndarray) -> np.ndarray:
    """Return the matrix that turns all coefficients up to degree 3, shape (16, 16)."""
    directions = _spread_directions(4 * (MAX_DEGREE + 1) ** 2)
    values_old = basis(directions @ rotation)  # rows: rotation^T applied to a direction
    return np.linalg.lstsq(basis(directions), values_old, rcond=None)[0]


def _spread_directions(count: int) -> np.ndarray:
    """Spread directions evenly over the sphere on a Fibonacci spiral, shape (count, 3)."""
    heights = 1 - (2 * np.arange(count) + 1) / count
    angles_rad = np.pi * (3 - math.sqrt(5)) * np.arange(count)
    radii = np.sqrt(1 - heights**2)
    return np.stack([radii * np.cos(angles_rad), radii * np.sin(angles_rad), heights], axis=-1)
