"""Rules of KHR_gaussian_splatting (KhronosGroup/glTF, extensions/2.0/Khronos)."""

import re
from collections.abc import Iterator
from typing import Any

from exporters.check import gaussians, numbers
from exporters.check.gltf.accessors import Accessors
from exporters.check.gltf.meshes import POINTS, primitives_of, type_problems
from exporters.check.problem import Problem

EXTENSION = "KHR_gaussian_splatting"
COLOR_SPACES = ("srgb_rec709_display", "lin_rec709_display")
_UNSIGNED = ("uint8", "uint16")
TYPES = {
    "ROTATION": {"VEC4 float32", "VEC4 int8 normalized", "VEC4 int16 normalized"},
    "SCALE": {
        "VEC3 float32",
        *(f"VEC3 {kind}{end}" for kind in _UNSIGNED for end in ("", " normalized")),
    },
    "OPACITY": {"SCALAR float32", *(f"SCALAR {kind} normalized" for kind in _UNSIGNED)},
}
_HARMONIC_TYPES = {"VEC3 float32"}
_HARMONIC = re.compile(rf"{EXTENSION}:SH_DEGREE_([0-9])_COEF_([0-9]+)")
_QUANTIZED_TOLERANCE = 0.05  # of the squared length: int8 steps by 1/127


def splat_problems(accessors: Accessors) -> Iterator[Problem]:
    """Every splat primitive is complete and activated, and no reader is shut out."""
    document = accessors.json
    is_used = False
    for place, primitive in primitives_of(document):
        if EXTENSION in primitive.get("extensions", {}):
            is_used = True
            yield from extension_problems(place, primitive)
            yield from harmonics_problems(f"{place}/attributes", primitive["attributes"])
            yield from _value_problems(f"{place}/attributes", accessors, primitive["attributes"])
    if is_used and EXTENSION not in document.get("extensionsUsed", []):
        yield Problem(place="/extensionsUsed", expected=EXTENSION, found="it is missing")
    if EXTENSION in document.get("extensionsRequired", []):
        yield Problem(
            place="/extensionsRequired",
            expected=f"no {EXTENSION}: readers that do not know it would refuse the whole file",
            found="it",
        )


def extension_problems(place: str, primitive: dict[str, Any]) -> Iterator[Problem]:
    """A splat primitive is drawn as points, and names its kernel and color space."""
    mode = primitive.get("mode", 4)
    if mode != POINTS:
        yield Problem(place=f"{place}/mode", expected=f"{POINTS}, points", found=str(mode))
    extension = primitive["extensions"][EXTENSION]
    where = f"{place}/extensions/{EXTENSION}"
    if not isinstance(extension, dict):
        yield Problem(place=where, expected="an object", found=repr(extension)[:40])
        return
    for name, known in (("kernel", ("ellipse",)), ("colorSpace", COLOR_SPACES)):
        if extension.get(name) not in known:
            found = repr(extension.get(name))[:40]
            yield Problem(place=f"{where}/{name}", expected=" or ".join(known), found=found)


def harmonics_problems(place: str, attributes: dict[str, int]) -> Iterator[Problem]:
    """Harmonics begin at degree 0, and every degree has its 2 l + 1 coefficients."""
    found = {(int(m[1]), int(m[2])) for m in map(_HARMONIC.fullmatch, attributes) if m}
    degree = max((degree for degree, _ in found), default=0)
    missing = [
        f"SH_DEGREE_{band}_COEF_{n}"
        for band in range(degree + 1)
        for n in range(2 * band + 1)
        if (band, n) not in found
    ]
    if missing or len(found) > (degree + 1) ** 2 or degree > 3:
        yield Problem(
            place=place,
            expected=f"all {(degree + 1) ** 2} coefficients of SH degree {degree}, 0..3",
            found=f"{len(found)}, without {', '.join(missing[:3]) or 'a gap'}",
        )


def _value_problems(
    place: str, accessors: Accessors, attributes: dict[str, int]
) -> Iterator[Problem]:
    for name, index in attributes.items():
        if _HARMONIC.fullmatch(name):
            yield from type_problems(f"{place}/{name}", accessors, index, _HARMONIC_TYPES)
    rules = {
        "ROTATION": lambda where, values: numbers.unit_quaternions(
            where, values, _QUANTIZED_TOLERANCE
        ),
        "SCALE": gaussians.linear_scales,
        "OPACITY": lambda where, values: gaussians.opacities(where, values[:, 0]),
    }
    for name, rule in rules.items():
        where = f"{place}/{EXTENSION}:{name}"
        index = attributes.get(f"{EXTENSION}:{name}")
        if index is None:
            yield Problem(place=where, expected="an accessor", found="nothing")
            continue
        wrong = [*type_problems(where, accessors, index, TYPES[name])]
        yield from wrong
        values = accessors.values(index)
        if values is not None and not wrong:
            yield from rule(where, values)
