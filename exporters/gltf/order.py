"""Where our conventions become glTF's: the only place that reorders quaternions and matrices."""

import numpy as np


def xyzw(quats_wxyz: np.ndarray) -> np.ndarray:
    """Return unit quaternions in glTF order (glTF 2.0, section 3.5.2: "x, y, z, w").

    Args:
        quats_wxyz: Quaternions in our order, shape (..., 4).

    Returns:
        The same rotations, normalized in float64 and rounded once, float32, shape (..., 4).
    """
    exact = np.asarray(quats_wxyz, dtype=np.float64)
    exact = exact / np.linalg.norm(exact, axis=-1, keepdims=True)
    return np.ascontiguousarray(exact[..., [1, 2, 3, 0]], dtype=np.float32)


def column_major(matrices: np.ndarray) -> np.ndarray:
    """Return affine matrices as glTF stores them (glTF 2.0, section 3.6.2.4: column-major).

    Args:
        matrices: Matrices that act on column vectors, shape (M, 4, 4).

    Returns:
        Column after column, last row exactly (0, 0, 0, 1), float32, shape (M, 16).
    """
    columns = np.array(np.swapaxes(matrices, -1, -2), dtype=np.float32)
    columns[..., :, 3] = [0.0, 0.0, 0.0, 1.0]
    return columns.reshape(-1, 16)
