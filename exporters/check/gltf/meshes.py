"""Rules for the geometry of meshes (glTF 2.0, section 3.7)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from exporters.check.gltf.accessors import Accessors
from exporters.check.problem import Problem, count_bad

POINTS, TRIANGLES = 0, 4
_UNSIGNED = {"SCALAR uint8", "SCALAR uint16", "SCALAR uint32"}
_COLORS = {
    f"{width} {component}"
    for width in ("VEC3", "VEC4")
    for component in ("float32", "uint8 normalized", "uint16 normalized")
}
ATTRIBUTE_TYPES = {
    "POSITION": {"VEC3 float32"},
    "NORMAL": {"VEC3 float32"},
    "TANGENT": {"VEC4 float32"},
    "TEXCOORD": {"VEC2 float32", "VEC2 uint8 normalized", "VEC2 uint16 normalized"},
    "COLOR": _COLORS,
    "JOINTS": {"VEC4 uint8", "VEC4 uint16"},
    "WEIGHTS": {"VEC4 float32", "VEC4 uint8 normalized", "VEC4 uint16 normalized"},
}
"""What each attribute may be (glTF 2.0, section 3.7.2.1), by its name without the number."""
QUANTIZATION = "KHR_mesh_quantization"
_QUANTIZED = ("POSITION", "NORMAL", "TANGENT", "TEXCOORD")


def primitives_of(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the place and the content of every primitive."""
    for mesh_index, mesh in enumerate(document.get("meshes", [])):
        for index, primitive in enumerate(mesh["primitives"]):
            yield f"/meshes/{mesh_index}/primitives/{index}", primitive


def mesh_problems(accessors: Accessors) -> Iterator[Problem]:
    """Every primitive has positions with bounds, attributes of one count, indices into them."""
    is_quantized = QUANTIZATION in accessors.json.get("extensionsRequired", [])
    for place, primitive in primitives_of(accessors.json):
        attributes = primitive["attributes"]
        if "POSITION" not in attributes:
            found = ", ".join(attributes) or "nothing"
            yield Problem(place=f"{place}/attributes", expected="POSITION", found=found)
            continue
        for name, index in attributes.items():
            where = f"{place}/attributes/{name}"
            yield from count_problems(where, accessors, index, attributes["POSITION"])
            allowed = ATTRIBUTE_TYPES.get(name.rstrip("0123456789").rstrip("_"))
            if allowed and not (is_quantized and name.startswith(_QUANTIZED)):
                yield from type_problems(where, accessors, index, allowed)
        yield from declared_bounds(
            f"{place}/attributes/POSITION", accessors, attributes["POSITION"]
        )
        if "indices" in primitive:
            yield from _index_problems(f"{place}/indices", accessors, primitive)


def count_problems(
    place: str, accessors: Accessors, index: int, positions: int
) -> Iterator[Problem]:
    """All attributes of a primitive have one value a vertex (3.7.2.1)."""
    if accessors.count(index) != accessors.count(positions):
        yield Problem(
            place=place,
            expected=f"{accessors.count(positions)} values, as many as POSITION",
            found=str(accessors.count(index)),
        )


def type_problems(
    place: str, accessors: Accessors, index: int, allowed: set[str]
) -> Iterator[Problem]:
    """An accessor is of a type that its use allows."""
    found = accessors.described(index)
    if found not in allowed:
        yield Problem(place=place, expected=" or ".join(sorted(allowed)), found=found)


def declared_bounds(place: str, accessors: Accessors, index: int) -> Iterator[Problem]:
    """Positions and key times declare their bounds (3.7.2.1 and 5.3)."""
    missing = [name for name in ("min", "max") if name not in accessors.json["accessors"][index]]
    if missing:
        yield Problem(
            place=place, expected=f"min and max in accessor {index}", found=f"no {missing[0]}"
        )


def index_problems(place: str, indices: np.ndarray, vertex_count: int) -> Iterator[Problem]:
    """Every index names a vertex (3.7.2.1).

    Args:
        place: Where they are.
        indices: Shape (M,).
        vertex_count: Number of vertices.
    """
    yield from count_bad(
        place,
        indices >= vertex_count,
        expected=f"vertices 0..{vertex_count - 1}",
        what="indices of others",
    )


def _index_problems(
    place: str, accessors: Accessors, primitive: dict[str, Any]
) -> Iterator[Problem]:
    index = primitive["indices"]
    yield from type_problems(place, accessors, index, _UNSIGNED)
    count = accessors.count(index)
    if primitive.get("mode", TRIANGLES) == TRIANGLES and count % 3:
        yield Problem(place=place, expected="three indices a triangle", found=f"{count} indices")
    indices = accessors.raw(index)
    if indices is not None:
        vertex_count = accessors.count(primitive["attributes"]["POSITION"])
        yield from index_problems(place, indices[:, 0], vertex_count)
