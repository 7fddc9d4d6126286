"""From numpy to Vt and Gf: the only place where quaternion order and matrix convention change.

* Our quaternions are wxyz. `Vt.Quat*Array.FromNumpy` reads memory, which USD lays out xyzw;
  `Gf.Quat*(w, x, y, z)` takes the real part first.
* Our matrices act on column vectors. USD's act on row vectors: each one is transposed.
"""

from collections.abc import Sequence

import numpy as np
from pxr import Gf, Vt

_BLOCK_ROWS = 8192
"""Quaternions reordered at a time: few enough for the processor's cache."""


def floats(numbers: np.ndarray) -> Vt.FloatArray:
    """Return float[] from shape (M,)."""
    return Vt.FloatArray.FromNumpy(np.ascontiguousarray(numbers, dtype=np.float32))


def ints(numbers: np.ndarray) -> Vt.IntArray:
    """Return int[] from shape (M,)."""
    return Vt.IntArray.FromNumpy(np.ascontiguousarray(numbers, dtype=np.int32))


def tokens(names: Sequence[str]) -> Vt.TokenArray:
    """Return token[]."""
    return Vt.TokenArray(list(names))


def vectors(rows: np.ndarray) -> Vt.Vec3fArray:
    """Return float3[] (or point3f[], color3f[]) from shape (M, 3)."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rows, dtype=np.float32))


def half_vectors(rows: np.ndarray) -> Vt.Vec3hArray:
    """Return half3[] from shape (M, 3)."""
    return Vt.Vec3hArray.FromNumpy(np.ascontiguousarray(rows, dtype=np.float16))


def xyzw(quats_wxyz: np.ndarray, dtype: type) -> np.ndarray:
    """Return quaternions as USD lays them out in memory, shape (M, 4)."""
    rows = np.empty(quats_wxyz.shape, dtype)
    for first in range(0, len(rows), _BLOCK_ROWS):
        block, source = rows[first : first + _BLOCK_ROWS], quats_wxyz[first : first + _BLOCK_ROWS]
        block.reshape(-1)[:-1] = source.reshape(-1)[1:]  # all but the last column, in one long copy
        block[:, 3] = source[:, 0]
    return rows


def quats(quats_wxyz: np.ndarray) -> Vt.QuatfArray:
    """Return quatf[] from shape (M, 4)."""
    return Vt.QuatfArray.FromNumpy(xyzw(quats_wxyz, np.float32))


def half_quats(quats_wxyz: np.ndarray) -> Vt.QuathArray:
    """Return quath[] from shape (M, 4).

    Rounding by 2^-11 of each number turns a unit quaternion by 2^-10 at most: 0.056 degrees.
    """
    return Vt.QuathArray.FromNumpy(xyzw(quats_wxyz, np.float16))


def quat(quat_wxyz: np.ndarray) -> Gf.Quatd:
    """Return one double quaternion from shape (4,)."""
    return Gf.Quatd(*(float(number) for number in quat_wxyz))


def vector(row: np.ndarray) -> Gf.Vec3d:
    """Return one double vector from shape (3,)."""
    return Gf.Vec3d(*(float(number) for number in row))


def matrices(column_matrices: np.ndarray) -> Vt.Matrix4dArray:
    """Return matrix4d[] from matrices for column vectors, shape (M, 4, 4)."""
    row_matrices = np.ascontiguousarray(column_matrices.swapaxes(1, 2), dtype=np.float64)
    return Vt.Matrix4dArray.FromNumpy(row_matrices)
