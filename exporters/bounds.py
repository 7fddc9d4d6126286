"""Boxes around Gaussians."""

import numpy as np

from exporters import quaternions
from exporters.clip import Posed

EXTENT_SIGMAS = (
    3.0  # the support of ParticleFieldKernelGaussianEllipsoidAPI, and of INRIA's renderer
)


def ellipsoid_extent(posed: Posed, scales: np.ndarray) -> np.ndarray:
    """Return the tight box around the 3-sigma ellipsoids.

    The half width of an ellipsoid with axes `R diag(s)` along a world axis is the norm of that row.

    Args:
        posed: Centers and rotations.
        scales: Standard deviations [scene unit], shape (N, 3).

    Returns:
        Rows min and max [scene unit], float32, shape (2, 3).
    """
    axes = quaternions.to_matrices(posed.quats_wxyz) * scales[:, None, :]
    half_widths = EXTENT_SIGMAS * np.sqrt(np.einsum("nij,nij->ni", axes, axes))
    low = (posed.positions - half_widths).min(axis=0)
    high = (posed.positions + half_widths).max(axis=0)
    return np.stack([low, high]).astype(np.float32)
