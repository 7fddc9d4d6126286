"""Values of attributes as numpy, without copying arrays. Quaternions come out xyzw."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pxr import Gf, Usd, Vt

_QUATERNIONS = (Gf.Quatd, Gf.Quatf, Gf.Quath)
_QUATERNION_ARRAYS = (Vt.QuatdArray, Vt.QuatfArray, Vt.QuathArray)


def numbers_of(value: Any) -> np.ndarray | None:
    """Return a value's numbers, None if it is text, a path or the like."""
    if isinstance(value, _QUATERNIONS):
        return np.array([*value.GetImaginary(), value.GetReal()])
    array = np.asarray(value)
    return array if array.dtype.kind in "fiu" else None


def is_quaternion(value: object) -> bool:
    """Say whether a value is a quaternion or an array of them."""
    return isinstance(value, _QUATERNIONS + _QUATERNION_ARRAYS)


def sample_times(attributes: Sequence[Usd.Attribute]) -> list[Usd.TimeCode]:
    """Return all times at which one of the attributes has a sample, else the default time."""
    times = sorted({time for attribute in attributes for time in attribute.GetTimeSamples()})
    return [Usd.TimeCode(time) for time in times] or [Usd.TimeCode.Default()]


def rows(attribute: Usd.Attribute, time: Usd.TimeCode | None = None) -> np.ndarray:
    """Return the array of an attribute at a time, an empty one if it has no value there.

    Its type is right: `attributes.type_problems` came first.
    """
    value = attribute.Get(Usd.TimeCode.Default() if time is None else time)
    return np.zeros(0) if value is None else np.asarray(value)


def first_rows(attribute: Usd.Attribute) -> np.ndarray:
    """Return the array of an attribute at its first sample, or its only value."""
    return rows(attribute, sample_times([attribute])[0])


def place(attribute: Usd.Attribute, time: Usd.TimeCode | None = None) -> str:
    """Return where a value lies: `/Lamp/Skel.joints`, or `/Lamp/Splats.positions at 12`."""
    where = f"{attribute.GetPrim().GetPath()}.{attribute.GetName()}"
    return where if time is None or time.IsDefault() else f"{where} at {time.GetValue():g}"
