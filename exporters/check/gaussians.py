"""Rules for activated Gaussians, the same in USD and glTF."""

import functools
from collections.abc import Iterator

import numpy as np

from exporters.check.problem import Problem, any_in_row, count_bad

SIGMAS = 3.0
"""Support of a Gaussian (USD, ParticleFieldKernelGaussianEllipsoidAPI)."""

EXTENT_TOLERANCE = 1e-4
"""Of the box's largest coordinate: boxes are computed in float32."""


def linear_scales(place: str, scales: np.ndarray) -> Iterator[Problem]:
    """Scales are standard deviations: negative ones are the logarithms that a PLY stores.

    USD: ParticleFieldScaleAttributeAPI. glTF: KHR_gaussian_splatting, SCALE.
    """
    yield from count_bad(
        place,
        any_in_row(scales <= 0),
        expected="linear scales > 0",
        what="Gaussians with others; are these logarithms?",
    )


def opacities(place: str, opacities: np.ndarray) -> Iterator[Problem]:
    """Opacities are in 0..1: others are the logits that a PLY stores.

    USD: ParticleFieldOpacityAttributeAPI. glTF: KHR_gaussian_splatting, OPACITY.
    """
    yield from count_bad(
        place,
        (opacities < 0) | (opacities > 1),
        expected="opacities in 0..1",
        what="Gaussians outside; are these logits?",
    )


def points_in_extent(place: str, extent: np.ndarray, points: np.ndarray) -> Iterator[Problem]:
    """The box holds the points (USD, UsdGeomBoundable extent).

    Args:
        place: Where the box is.
        extent: Rows min and max, shape (2, 3).
        points: Shape (N, 3).
    """
    low, high = _widened(extent)
    yield from count_bad(
        place,
        any_in_row((points < low) | (points > high)),
        expected="a box around all points",
        what="points outside",
    )


def ellipsoids_in_extent(
    place: str,
    extent: np.ndarray,
    positions: np.ndarray,
    quats_xyzw: np.ndarray,
    scales: np.ndarray,
) -> Iterator[Problem]:
    """The box holds the 3-sigma ellipsoids (USD, UsdGeomBoundable extent with the kernel above).

    Args:
        place: Where the box is.
        extent: Rows min and max, shape (2, 3).
        positions: Centers, shape (N, 3).
        quats_xyzw: Unit rotations, shape (N, 4).
        scales: Standard deviations, shape (N, 3).
    """
    low, high = _widened(extent)
    reach = SIGMAS * functools.reduce(np.maximum, scales.T)[:, None]
    # Whoever stays inside as a ball stays inside as an ellipsoid: few are left to look at.
    near = any_in_row((positions - reach < low) | (positions + reach > high))
    x, y, z, w = quats_xyzw[near].astype(np.float64).T
    rows = np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )
    half_widths = SIGMAS * np.linalg.norm(rows * scales[near][:, None, :], axis=-1)
    is_outside = np.zeros(len(positions), bool)
    is_outside[near] = any_in_row(
        (positions[near] - half_widths < low) | (positions[near] + half_widths > high)
    )
    yield from count_bad(
        place,
        is_outside,
        expected="a box around all 3-sigma ellipsoids",
        what="Gaussians that reach outside",
    )


def _widened(extent: np.ndarray) -> np.ndarray:
    margin = EXTENT_TOLERANCE * float(np.abs(extent).max(initial=0.0))
    return extent + np.array([[-margin], [margin]], dtype=np.float32)
