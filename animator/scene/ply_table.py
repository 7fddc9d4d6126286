"""The vertex table of an untrusted PLY file, as named columns.

Format: http://paulbourke.net/dataformats/ply/. Nothing is allocated before the counts of the
header were checked against the size of the file.
"""

import dataclasses
import re
from pathlib import Path
from typing import BinaryIO

import numpy as np

from animator.errors import InputError

_MAX_HEADER_BYTES = 2**20
_DTYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "half": "f2", "float16": "f2", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PlyTable:
    """What the element `vertex` of a PLY file holds."""

    columns: dict[str, np.ndarray]
    """Property name to values, each of shape (N,)."""
    comments: tuple[str, ...]
    """The header's comments."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Element:
    name: str
    count: int
    properties: tuple[tuple[str, str], ...]
    """Name and numpy type without byte order."""
    has_lists: bool

    def dtype(self, byte_order: str) -> np.dtype:
        return np.dtype([(name, byte_order + kind) for name, kind in self.properties])


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Header:
    encoding: str
    elements: tuple[_Element, ...]
    comments: tuple[str, ...]
    size_bytes: int

    @property
    def vertex_index(self) -> int:
        return [element.name for element in self.elements].index("vertex")

    @property
    def before(self) -> tuple[_Element, ...]:
        return self.elements[: self.vertex_index]

    @property
    def vertex(self) -> _Element:
        return self.elements[self.vertex_index]

    @property
    def after(self) -> tuple[_Element, ...]:
        return self.elements[self.vertex_index + 1 :]


def read_ply_table(path: Path) -> PlyTable:
    """Read the vertices of a PLY file: ascii or binary of either byte order, any scalar types.

    Raises:
        InputError: If it is no PLY file, its header is malformed, or it is cut off.
    """
    try:
        with path.open("rb") as file:
            header = _read_header(file, path)
            _require_vertex(header, path)
            body_bytes = path.stat().st_size - header.size_bytes
            read_body = _read_ascii if header.encoding == "ascii" else _read_binary
            columns = read_body(file, header, body_bytes, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}.") from error
    return PlyTable(columns=columns, comments=header.comments)


def _read_header(file: BinaryIO, path: Path) -> _Header:
    start = file.read(_MAX_HEADER_BYTES)
    if not re.match(rb"ply\r?\n", start):
        raise InputError(f"{path}: expected a PLY file, found one that starts with {start[:8]!r}.")
    end = re.search(rb"\nend_header[ \t]*\r?\n", start)
    if end is None:
        raise InputError(
            f"{path}: the PLY header has no line end_header in its first "
            f"{min(len(start), _MAX_HEADER_BYTES):,} bytes; is the file cut off?"
        )
    lines = start[: end.start()].decode("ascii", errors="replace").splitlines()
    encoding = ""
    comments: list[str] = []
    elements: list[_Element] = []
    for number, line in enumerate(lines[1:], start=2):
        where = f"{path}: header line {number}"
        match line.split():
            case [] | ["obj_info", *_]:
                pass
            case ["comment", *_]:
                comments.append(line.partition("comment")[2].strip())
            case ["format", encoding, _] if encoding in _BYTE_ORDERS:
                pass
            case ["element", name, count] if re.fullmatch("[0-9]{1,18}", count):
                elements.append(
                    _Element(name=name, count=int(count), properties=(), has_lists=False)
                )
            case ["property", "list", _, _, _] if elements:
                elements[-1] = dataclasses.replace(elements[-1], has_lists=True)
            case ["property", kind, name] if elements and kind in _DTYPES:
                elements[-1] = _with_property(elements[-1], name, _DTYPES[kind], where)
            case _:
                raise InputError(f"{where}: cannot be understood: {line[:80]!r}.")
    if not encoding:
        raise InputError(f"{path}: the PLY header has no line format.")
    return _Header(
        encoding=encoding,
        elements=tuple(elements),
        comments=tuple(comments),
        size_bytes=end.end(),
    )


def _with_property(element: _Element, name: str, kind: str, where: str) -> _Element:
    if any(name == known for known, _ in element.properties):
        raise InputError(f"{where}: the property {name} of {element.name} is there twice.")
    return dataclasses.replace(element, properties=(*element.properties, (name, kind)))


def _require_vertex(header: _Header, path: Path) -> None:
    names = [element.name for element in header.elements]
    if "vertex" not in names:
        raise InputError(
            f"{path}: expected an element vertex, found {', '.join(names) or 'no elements'}."
        )
    vertex = header.vertex
    if vertex.count == 0:
        raise InputError(f"{path}: element vertex: expected at least one Gaussian, found 0.")
    if vertex.has_lists or any(element.has_lists for element in header.before):
        raise InputError(
            f"{path}: expected plain numbers in and before the element vertex, found a list "
            "property; Gaussian splats have none."
        )
    if not vertex.properties:
        raise InputError(f"{path}: element vertex: expected properties, found none.")


def _read_binary(
    file: BinaryIO, header: _Header, body_bytes: int, path: Path
) -> dict[str, np.ndarray]:
    byte_order = _BYTE_ORDERS[header.encoding]
    vertex = header.vertex
    row_type = vertex.dtype(byte_order)
    skipped_bytes = _size_bytes(header.before, byte_order)
    end_bytes = skipped_bytes + vertex.count * row_type.itemsize
    if end_bytes > body_bytes:
        whole_rows = max(0, body_bytes - skipped_bytes) // row_type.itemsize
        raise _cut_off(vertex.count, row_type.itemsize, whole_rows, path)
    if not any(element.has_lists for element in header.after):
        end_bytes += _size_bytes(header.after, byte_order)
        if end_bytes != body_bytes:
            raise InputError(
                f"{path}: the header describes {end_bytes:,} bytes of data, the file holds "
                f"{body_bytes:,}; the counts or types in the header do not belong to this data."
            )
    file.seek(header.size_bytes + skipped_bytes)
    rows = np.fromfile(file, dtype=row_type, count=vertex.count)
    return {name: rows[name] for name, _ in vertex.properties}


def _read_ascii(
    file: BinaryIO, header: _Header, body_bytes: int, path: Path
) -> dict[str, np.ndarray]:
    vertex = header.vertex
    column_count = len(vertex.properties)
    least_bytes = 2 * column_count  # a digit and a separator for each number
    if vertex.count * least_bytes > body_bytes + 1:
        raise _cut_off(vertex.count, least_bytes, body_bytes // least_bytes, path)
    file.seek(header.size_bytes)
    for element in header.before:
        for _ in range(element.count):
            if not file.readline():
                raise InputError(f"{path}: cut off in the element {element.name}.")
    try:
        rows = np.loadtxt(
            file, dtype=np.float64, comments=None, max_rows=vertex.count, ndmin=2, encoding="latin1"
        )
    except ValueError as error:
        raise InputError(
            f"{path}: element vertex: expected {column_count} numbers a line ({error})."
        ) from error
    if rows.shape != (vertex.count, column_count):
        raise InputError(
            f"{path}: cut off: expected {vertex.count:,} lines of {column_count} numbers, found "
            f"{rows.shape[0]:,} of {rows.shape[1]}; copy or export the file again."
        )
    return {name: rows[:, column] for column, (name, _) in enumerate(vertex.properties)}


def _size_bytes(elements: tuple[_Element, ...], byte_order: str) -> int:
    return sum(element.count * element.dtype(byte_order).itemsize for element in elements)


def _cut_off(count: int, row_bytes: int, whole_rows: int, path: Path) -> InputError:
    return InputError(
        f"{path}: cut off: the header promises {count:,} Gaussians of {row_bytes} bytes, the "
        f"file holds {whole_rows:,} whole ones; copy or export the file again."
    )
