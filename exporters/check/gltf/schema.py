"""Which members a glTF document must and may have, as far as the other rules read them.

glTF 2.0, chapter 5, by hand for the dozen objects of a skinned, animated mesh; after this the other
rules may trust types and references. Members that are not listed are not looked at.
"""

import dataclasses
from collections.abc import Iterator
from typing import Any

from exporters.check.problem import Problem

VERSION = "2."

MAX_EXACT = 2**53
"""JSON integers from here on are not exact everywhere (RFC 8259, section 6)."""

LARGEST = 3.5e38
"""Just above the largest float32, the widest number glTF stores."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Member:
    """What one member of an object has to be."""

    kind: str
    """`object`, `string`, `integer`, `number` or `index`."""
    of: str = ""
    """For an object, its row in `OBJECTS`; for an index, the list it points into."""
    holds: str = "one"
    """`one`, `list` or `map` of them."""
    is_required: bool = False


def _one(kind: str, of: str = "", *, required: bool = False) -> Member:
    return Member(kind=kind, of=of, is_required=required)


def _list(kind: str, of: str = "", *, required: bool = False) -> Member:
    return Member(kind=kind, of=of, holds="list", is_required=required)


OBJECTS: dict[str, dict[str, Member]] = {
    "glTF": {
        "asset": _one("object", "asset", required=True),
        "scene": _one("index", "scenes"),
        "extensionsUsed": _list("string"),
        "extensionsRequired": _list("string"),
        **{
            name: _list("object", name)
            for name in (
                *("accessors", "animations", "bufferViews", "buffers", "cameras", "materials"),
                *("meshes", "nodes", "scenes", "skins"),
            )
        },
    },
    "asset": {"version": _one("string", required=True)},
    "buffers": {"byteLength": _one("integer", required=True), "uri": _one("string")},
    "bufferViews": {
        "buffer": _one("index", "buffers", required=True),
        "byteOffset": _one("integer"),
        "byteLength": _one("integer", required=True),
        "byteStride": _one("integer"),
        "extensions": _one("object"),
    },
    "accessors": {
        "bufferView": _one("index", "bufferViews"),
        "byteOffset": _one("integer"),
        "componentType": _one("integer", required=True),
        "count": _one("integer", required=True),
        "type": _one("string", required=True),
        "min": _list("number"),
        "max": _list("number"),
        "sparse": _one("object"),
    },
    "scenes": {"nodes": _list("index", "nodes")},
    "nodes": {
        "name": _one("string"),
        "children": _list("index", "nodes"),
        "mesh": _one("index", "meshes"),
        "skin": _one("index", "skins"),
        "camera": _one("index", "cameras"),
        "translation": _list("number"),
        "rotation": _list("number"),
        "scale": _list("number"),
        "matrix": _list("number"),
    },
    "meshes": {"primitives": _list("object", "primitives", required=True)},
    "primitives": {
        "attributes": Member(kind="index", of="accessors", holds="map", is_required=True),
        "indices": _one("index", "accessors"),
        "material": _one("index", "materials"),
        "mode": _one("integer"),
        "extensions": _one("object"),
    },
    "skins": {
        "joints": _list("index", "nodes", required=True),
        "inverseBindMatrices": _one("index", "accessors"),
        "skeleton": _one("index", "nodes"),
    },
    "animations": {
        "channels": _list("object", "channels", required=True),
        "samplers": _list("object", "samplers", required=True),
    },
    "channels": {
        "sampler": _one("integer", required=True),  # points into its own animation
        "target": _one("object", "targets", required=True),
    },
    "targets": {"node": _one("index", "nodes"), "path": _one("string", required=True)},
    "samplers": {
        "input": _one("index", "accessors", required=True),
        "output": _one("index", "accessors", required=True),
        "interpolation": _one("string"),
    },
    "cameras": {"type": _one("string", required=True)},
    "materials": {},
}
"""Members by the list, or the object, they are in."""

_TYPES = {"object": dict, "string": str, "integer": int, "number": int | float, "index": int}


def schema_problems(document: dict[str, Any]) -> Iterator[Problem]:
    """Every member has its type, every index points at something (glTF 2.0, section 5.1)."""
    problems = [*_object_problems(document, "glTF", "", document)]
    yield from problems
    if not problems and not document["asset"]["version"].startswith(VERSION):
        version = document["asset"]["version"]
        yield Problem(place="/asset/version", expected="2.0", found=repr(version))


def _object_problems(
    value: dict[str, Any], name: str, place: str, document: dict[str, Any]
) -> Iterator[Problem]:
    for key, member in OBJECTS.get(name, {}).items():
        where = f"{place}/{key}"
        if key not in value:
            if member.is_required:
                yield Problem(place=where, expected=_described(member), found="nothing")
            continue
        container = {"one": None, "list": list, "map": dict}[member.holds]
        if container is None:
            yield from _value_problems(value[key], member, where, document)
        elif not isinstance(value[key], container):
            yield Problem(place=where, expected=_described(member), found=_short(value[key]))
        else:
            items = value[key].items() if container is dict else enumerate(value[key])
            for index, item in items:
                yield from _value_problems(item, member, f"{where}/{index}", document)


def _value_problems(
    value: Any, member: Member, place: str, document: dict[str, Any]
) -> Iterator[Problem]:
    if not isinstance(value, _TYPES[member.kind]) or isinstance(value, bool):
        one = dataclasses.replace(member, holds="one")
        yield Problem(place=place, expected=_described(one), found=_short(value))
    elif isinstance(value, dict):
        yield from _object_problems(value, member.of, place, document)
    elif member.kind == "index":
        targets = document.get(member.of)
        count = len(targets) if isinstance(targets, list) else 0
        if not 0 <= value < count:
            yield Problem(
                place=place, expected=f"an index into {count} {member.of}", found=str(value)
            )
    elif member.kind == "integer" and not 0 <= value < MAX_EXACT:
        yield Problem(place=place, expected="an integer >= 0", found=_short(value))
    elif member.kind == "number" and not -LARGEST <= value <= LARGEST:
        yield Problem(place=place, expected="a number that floats can hold", found=_short(value))


def _described(member: Member) -> str:
    kind = f"{member.kind} into {member.of}" if member.kind == "index" else member.kind
    return {"one": kind, "list": f"a list of {kind}", "map": f"an object of {kind}"}[member.holds]


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
