"""Rules for animations (glTF 2.0, section 3.11)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from exporters.check import numbers
from exporters.check.gltf.accessors import Accessors
from exporters.check.gltf.meshes import declared_bounds, type_problems
from exporters.check.problem import Problem

_ROTATIONS = {
    "VEC4 float32",
    *(f"VEC4 {kind} normalized" for kind in ("int8", "uint8", "int16", "uint16")),
}
PATHS = {"translation": {"VEC3 float32"}, "rotation": _ROTATIONS, "scale": {"VEC3 float32"}}
"""What the keys of each animated property may be."""
_KEY_VALUES = {"LINEAR": 1, "STEP": 1, "CUBICSPLINE": 3}
"""How many values a key has, by interpolation."""
_QUANTIZED_TOLERANCE = 0.05  # of the squared length: int8 steps by 1/127


def animation_problems(accessors: Accessors) -> Iterator[Problem]:
    """Every channel drives one property of a node, with keys in order and a value for each."""
    for number, animation in enumerate(accessors.json.get("animations", [])):
        place = f"/animations/{number}"
        yield from target_problems(place, animation, accessors.json)
        samplers = animation["samplers"]
        paths: dict[int, str] = {}
        for index, channel in enumerate(animation["channels"]):
            if channel["sampler"] < len(samplers):
                paths[channel["sampler"]] = channel["target"]["path"]
                continue
            yield Problem(
                place=f"{place}/channels/{index}/sampler",
                expected=f"one of {len(samplers)} samplers",
                found=str(channel["sampler"]),
            )
        for sampler, path in paths.items():
            if path in PATHS:
                where = f"{place}/samplers/{sampler}"
                yield from _value_problems(where, accessors, samplers[sampler], path)
        yield from _clock_problems(place, accessors, [samplers[index] for index in paths])


def target_problems(
    place: str, animation: dict[str, Any], document: dict[str, Any]
) -> Iterator[Problem]:
    """Every channel has a target of its own that can be animated (3.11 and 5.7)."""
    seen = set()
    for index, channel in enumerate(animation["channels"]):
        where = f"{place}/channels/{index}/target"
        target = channel["target"]
        if target["path"] not in (*PATHS, "weights"):
            expected = ", ".join((*PATHS, "weights"))
            yield Problem(place=f"{where}/path", expected=expected, found=repr(target["path"])[:40])
        if "node" not in target:
            continue  # for extensions; readers ignore the channel
        pair = target["node"], target["path"]
        if pair in seen:
            found = f"the {pair[1]} of node {pair[0]} again"
            yield Problem(place=where, expected="another target in each channel", found=found)
        seen.add(pair)
        if "matrix" in document["nodes"][target["node"]]:
            expected = "a node with translation, rotation and scale"
            yield Problem(place=f"{where}/node", expected=expected, found="one with a matrix")


def _clock_problems(
    place: str, accessors: Accessors, samplers: list[dict[str, Any]]
) -> Iterator[Problem]:
    """Keys are in order, and the first of the whole animation is at 0 s, where the clip begins."""
    starts = []
    for index in dict.fromkeys(sampler["input"] for sampler in samplers):  # usually one for all
        where = f"{place}: times in accessor {index}"
        yield from type_problems(where, accessors, index, {"SCALAR float32"})
        yield from declared_bounds(where, accessors, index)
        times = accessors.raw(index)
        if times is not None:
            yield from numbers.key_times(where, times[:, 0], unit="s")
            starts.append(float(times[0, 0]))
    if starts and min(starts) > 0:
        yield Problem(place=place, expected="a first key at 0 s", found=f"at {min(starts):g} s")


def _value_problems(
    place: str, accessors: Accessors, sampler: dict[str, Any], path: str
) -> Iterator[Problem]:
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation not in _KEY_VALUES:
        expected = ", ".join(_KEY_VALUES)
        yield Problem(place=f"{place}/interpolation", expected=expected, found=interpolation)
        return
    where, index = f"{place}/output", sampler["output"]
    yield from type_problems(where, accessors, index, PATHS[path])
    key_count = accessors.count(sampler["input"])
    expected_count = key_count * _KEY_VALUES[interpolation]
    if accessors.count(index) != expected_count:
        found = str(accessors.count(index))
        expected = f"{expected_count} values for {key_count} keys"
        yield Problem(place=where, expected=expected, found=found)
        return
    values = accessors.values(index)
    if path == "rotation" and values is not None and values.shape[1] == 4:
        if interpolation == "CUBICSPLINE":
            values = values[1::3]  # in-tangent, value, out-tangent
        yield from rotation_problems(where, values, accessors.described(index) == "VEC4 float32")


def rotation_problems(place: str, quats_xyzw: np.ndarray, is_float: bool) -> Iterator[Problem]:
    """Rotation keys have unit length, each on the side of the one before.

    Args:
        place: Where they are.
        quats_xyzw: Keys, shape (T, 4).
        is_float: Whether they are stored as floats, and so exact.
    """
    tolerance = numbers.UNIT_TOLERANCE if is_float else _QUANTIZED_TOLERANCE
    yield from numbers.unit_quaternions(place, quats_xyzw, tolerance)
    yield from numbers.continuous_signs(place, quats_xyzw[:-1], quats_xyzw[1:])
