"""Rules for accessors, and their numbers once they keep them (glTF 2.0, sections 3.6.2 and 5.1)."""

import dataclasses
import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

from exporters.check import numbers
from exporters.check.problem import Problem

COMPONENTS = {
    5120: np.dtype("i1"),
    5121: np.dtype("u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Accessors:
    """The accessors of a document whose schema and buffers are sound."""

    json: dict[str, Any]
    """The document."""
    buffers: tuple[np.ndarray | None, ...]
    """Bytes of each buffer, uint8; None for one that is not there."""

    @functools.cached_property
    def problems(self) -> dict[int, list[Problem]]:
        """What is wrong with each accessor's place in its buffer."""
        accessors = self.json.get("accessors", [])
        return {index: [*self._placement(index)] for index in range(len(accessors))}

    def described(self, index: int) -> str:
        """Return type and component, such as `VEC3 float32`."""
        accessor = self.json["accessors"][index]
        component = COMPONENTS.get(accessor["componentType"])
        normalized = " normalized" if accessor.get("normalized") else ""
        return f"{accessor['type']} {component.name if component else '?'}{normalized}"

    def count(self, index: int) -> int:
        """Return the number of elements promised."""
        return self.json["accessors"][index]["count"]

    def raw(self, index: int) -> np.ndarray | None:
        """Return the numbers as stored, shape (count, width), a view of the buffer.

        None if the accessor is broken, or nothing here can read it: sparse, without a buffer view,
        compressed, or a matrix with padding.
        """
        accessor = self.json["accessors"][index]
        view_index = accessor.get("bufferView")
        if self.problems[index] or view_index is None or "sparse" in accessor:
            return None
        view = self.json["bufferViews"][view_index]
        blob = self.buffers[view["buffer"]]
        component, width = COMPONENTS[accessor["componentType"]], WIDTHS[accessor["type"]]
        is_padded = accessor["type"].startswith("MAT") and component.itemsize < 4
        if blob is None or view.get("extensions") or is_padded:
            return None
        return np.ndarray(
            (accessor["count"], width),
            component,
            buffer=blob,
            offset=view.get("byteOffset", 0) + accessor.get("byteOffset", 0),
            strides=(self._stride(index), component.itemsize),
        )

    def values(self, index: int) -> np.ndarray | None:
        """Return the numbers meant: normalized integers become fractions (section 3.11)."""
        raw = self.raw(index)
        if raw is None or not self.json["accessors"][index].get("normalized"):
            return raw
        largest = np.iinfo(raw.dtype).max if raw.dtype.kind in "iu" else 1
        return np.maximum(raw.astype(np.float32) / np.float32(largest), -1)

    def _stride(self, index: int) -> int:
        accessor = self.json["accessors"][index]
        size = COMPONENTS[accessor["componentType"]].itemsize * WIDTHS[accessor["type"]]
        return self.json["bufferViews"][accessor["bufferView"]].get("byteStride", size)

    def _placement(self, index: int) -> Iterator[Problem]:
        """Types are known, and every element lies in the view, the view in the buffer."""
        accessor = self.json["accessors"][index]
        place = f"/accessors/{index}"
        component = COMPONENTS.get(accessor["componentType"])
        width = WIDTHS.get(accessor["type"])
        if component is None or width is None or accessor["count"] < 1:
            found = f"{accessor['componentType']}, {accessor['type']}, count {accessor['count']}"
            expected = "a componentType, a type and a count of glTF 2.0"
            yield Problem(place=place, expected=expected, found=found)
            return
        if "bufferView" not in accessor:
            return
        view = self.json["bufferViews"][accessor["bufferView"]]
        if view.get("extensions"):
            return  # compressed: its bytes are not the elements
        buffer_bytes = self.json["buffers"][view["buffer"]]["byteLength"]
        view_end = view.get("byteOffset", 0) + view["byteLength"]
        if view_end > buffer_bytes:
            yield Problem(
                place=f"/bufferViews/{accessor['bufferView']}",
                expected=f"an end within the buffer's {buffer_bytes} bytes",
                found=f"byte {view_end}",
            )
        size, stride = component.itemsize * width, self._stride(index)
        end = accessor.get("byteOffset", 0) + stride * (accessor["count"] - 1) + size
        if stride < size or end > view["byteLength"]:
            yield Problem(
                place=place,
                expected=f"elements within the view's {view['byteLength']} bytes",
                found=f"{accessor['count']} of {size} bytes every {stride}, to byte {end}",
            )
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        if start % component.itemsize or stride % component.itemsize:
            yield Problem(
                place=place,
                expected=f"elements on multiples of {component.itemsize} bytes",
                found=f"offset {start}, stride {stride}",
            )


def accessor_problems(accessors: Accessors) -> Iterator[Problem]:
    """Every accessor lies in its buffer, holds finite numbers and tells true bounds."""
    for index, problems in accessors.problems.items():
        yield from problems
        raw = accessors.raw(index)
        if raw is None:
            continue
        place = f"/accessors/{index}"
        if raw.dtype.kind == "f":
            yield from numbers.finite(place, raw)
        accessor = accessors.json["accessors"][index]
        for name, bound in (("min", np.min), ("max", np.max)):
            if name in accessor:
                yield from bound_problems(f"{place}/{name}", accessor[name], bound(raw, axis=0))


def bound_problems(place: str, declared: list[float], actual: np.ndarray) -> Iterator[Problem]:
    """Bounds are those of the numbers, in the numbers' own precision (section 3.6.2.5)."""
    exact = np.asarray(declared, np.float64)
    in_precision = exact.astype(np.float32) if actual.dtype.kind == "f" else exact
    if not np.array_equal(in_precision, actual) and np.isfinite(actual).all():
        yield Problem(place=place, expected=str(actual.tolist()), found=str(declared)[:200])
