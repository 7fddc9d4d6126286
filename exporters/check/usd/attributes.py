"""Rules for every attribute of a stage, whatever it is for."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from pxr import Sdf, Usd

from exporters.check import numbers
from exporters.check.problem import Problem
from exporters.check.usd.values import is_quaternion, numbers_of, place, sample_times


def type_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Every opinion has the type that the schema of its prim names (USD, "Schema")."""
    for attribute in _attributes(stage):
        expected = attribute.GetTypeName()
        for opinion in attribute.GetPropertyStack():
            if opinion.typeName.cppTypeName != expected.cppTypeName:
                found = f"{opinion.typeName} in {opinion.layer.GetDisplayName()}"
                yield Problem(place=place(attribute), expected=str(expected), found=found)


def value_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Every number is finite, every quaternion of unit length and continuous in sign.

    Samples are read one by one; the first bad one of an attribute is reported.
    """
    for attribute in _attributes(stage):
        previous: np.ndarray | None = None
        for time in sample_times([attribute]):
            value = attribute.Get(time)
            problems = [*_asset_problems(place(attribute, time), value)]
            values = numbers_of(value)
            if values is not None:
                problems += numbers.finite(place(attribute, time), values)
            if values is not None and is_quaternion(value):
                problems += numbers.unit_quaternions(place(attribute, time), values)
                if previous is not None and previous.shape == values.shape:
                    where = place(attribute, time)
                    problems += numbers.continuous_signs(where, previous, values)
                previous = values
            yield from problems
            if problems:
                break


def time_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Samples lie between the stage's start and end time codes, which begin at 0.

    three.js plays time code t at t / fps, whatever the start says; glTF begins at 0 s.
    """
    start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    if not stage.HasAuthoredTimeCodeRange() or start != 0 or end < start:
        expected = "startTimeCode 0, and endTimeCode not below"
        found = f"{start:g} and {end:g}" if stage.HasAuthoredTimeCodeRange() else "none"
        yield Problem(place="stage", expected=expected, found=found)
        return
    first = np.inf
    for attribute in _attributes(stage):
        times = attribute.GetTimeSamples()
        if not times:
            continue
        first = min(first, times[0])
        if times[0] < start or times[-1] > end:
            yield Problem(
                place=place(attribute),
                expected=f"samples in {start:g}..{end:g}, the stage's time codes",
                found=f"samples in {times[0]:g}..{times[-1]:g}",
            )
    if np.isfinite(first) and first > start:
        yield Problem(
            place="stage", expected=f"a first sample at {start:g}", found=f"one at {first:g}"
        )


def _attributes(stage: Usd.Stage) -> Iterator[Usd.Attribute]:
    for prim in stage.Traverse():
        yield from prim.GetAuthoredAttributes()


def _asset_problems(where: str, value: Any) -> Iterator[Problem]:
    """Every asset path resolves (USD, "Asset Resolution")."""
    assets = [value] if isinstance(value, Sdf.AssetPath) else []
    if isinstance(value, Sdf.AssetPathArray):
        assets = [*value]
    for asset in assets:
        if asset.path and not asset.resolvedPath:
            yield Problem(place=where, expected="a file that is there", found=repr(asset.path))
