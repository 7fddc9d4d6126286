"""Rules for numbers of any format: finite, of unit length, continuous, in order.

A number that is not finite is reported by `finite` alone: it passes every other rule here.
"""

from collections.abc import Iterator

import numpy as np

from exporters.check.problem import Problem, count_bad

UNIT_TOLERANCE = 2e-3
"""Of a quaternion's squared length: rounding to 16 bits changes it by up to 1e-3."""

SIGN_TOLERANCE = 1e-3
"""Half a turn has cosine 0, which rounding may push below."""


def finite(place: str, values: np.ndarray) -> Iterator[Problem]:
    """Every number is finite: no format has a meaning for others, and JSON cannot hold them."""
    yield from count_bad(
        place,
        ~np.isfinite(values),
        expected="finite numbers",
        what="numbers that are not finite",
    )


def unit_quaternions(
    place: str, quats: np.ndarray, tolerance: float = UNIT_TOLERANCE
) -> Iterator[Problem]:
    """Every quaternion has unit length (glTF 2.0, section 3.11; USD, UsdSkelAnimation rotations).

    Args:
        place: Where they are.
        quats: In either order, shape (..., 4).
        tolerance: How far the squared length may be from 1.
    """
    quats = quats.astype(np.float32, copy=False)
    squares = np.einsum("...i,...i->...", quats, quats)
    yield from count_bad(
        place,
        np.abs(squares - 1) > tolerance,
        expected="unit quaternions",
        what="quaternions of another length",
    )


def continuous_signs(place: str, before: np.ndarray, after: np.ndarray) -> Iterator[Problem]:
    """No quaternion is on the far side of the one a key before.

    q and -q are one rotation, but a tool that mixes the numbers would turn the long way.

    Args:
        place: Where the later ones are.
        before: In either order, shape (M, 4).
        after: The same quaternions a key later, shape (M, 4).
    """
    before, after = before.astype(np.float32, copy=False), after.astype(np.float32, copy=False)
    yield from count_bad(
        place,
        np.einsum("...i,...i->...", before, after) < -SIGN_TOLERANCE,
        expected="quaternions on the side of those a key before",
        what="whose sign jumps",
    )


def key_times(place: str, times: np.ndarray, *, unit: str) -> Iterator[Problem]:
    """Key times begin at 0 or later and increase strictly (glTF 2.0, section 3.11).

    Args:
        place: Where they are.
        times: Shape (T,).
        unit: Of the times, for the message.
    """
    yield from count_bad(
        place,
        ~(np.diff(times) > 0),
        expected=f"times [{unit}] that increase strictly",
        what="keys not before the next",
    )
    yield from count_bad(place, times < 0, expected=f"times [{unit}] from 0", what="negative times")
