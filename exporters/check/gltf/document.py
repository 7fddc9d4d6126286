"""A .glb or .gltf taken apart: its JSON, and its buffers as bytes on disk.

Whatever the file says is compared with its size first; buffers are mapped, not read.
"""

import base64
import binascii
import dataclasses
import json
import struct
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import numpy as np

from exporters.check.problem import Problem

HEADER = struct.Struct("<4sII")
CHUNK = struct.Struct("<I4s")
MAX_JSON_BYTES = 2**28
_DATA_URI = "data:"


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class GltfDocument:
    """The two halves of a file."""

    json: dict[str, Any]
    """The document, not checked yet."""
    path: Path
    """Where buffers beside it are looked for."""
    blob: np.ndarray | None
    """The binary chunk of a .glb, uint8."""


def read_document(path: Path) -> GltfDocument | list[Problem]:
    """Take a file apart; return the problems instead if it cannot be (glTF 2.0, section 4.4)."""
    data = _mapped(path)
    if path.suffix.lower() == ".gltf":
        return _parsed(path, bytes(data[:MAX_JSON_BYTES]), None)
    problems = [*container_problems(data)]
    if problems:
        return problems
    chunks = dict(reversed([*_chunks(data)]))  # the first of a kind counts
    return _parsed(path, bytes(chunks[b"JSON"][:MAX_JSON_BYTES]), chunks.get(b"BIN\0"))


def container_problems(data: np.ndarray) -> Iterator[Problem]:
    """A .glb is a header and chunks that fill it to its end (glTF 2.0, section 4.4).

    Args:
        data: The whole file, uint8.
    """
    expected = f"`glTF`, version 2, {data.size} bytes"
    if data.size < HEADER.size:
        yield Problem(place="GLB header", expected="12 bytes", found=f"{data.size} bytes")
        return
    magic, version, length = HEADER.unpack(bytes(data[: HEADER.size]))
    if (magic, version, length) != (b"glTF", 2, data.size):
        found = f"{magic!r}, version {version}, {length} bytes"
        yield Problem(place="GLB header", expected=expected, found=found)
        return
    position = HEADER.size
    number = 0
    while position < data.size:
        place = f"GLB chunk {number}"
        rest = data.size - position - CHUNK.size
        if rest < 0:
            yield Problem(place=place, expected="a header of 8 bytes", found="the end of the file")
            return
        size, kind = CHUNK.unpack(bytes(data[position : position + CHUNK.size]))
        if size > rest or size % 4:
            expected = f"at most {rest} bytes, a multiple of 4"
            yield Problem(place=place, expected=expected, found=f"{size} bytes")
            return
        if number == 0 and kind != b"JSON":
            yield Problem(place=place, expected="the chunk JSON", found=repr(kind))
            return
        position += CHUNK.size + size
        number += 1
    if number == 0:
        yield Problem(place="GLB chunk 0", expected="the chunk JSON", found="the end of the file")


def open_buffers(document: GltfDocument) -> tuple[list[np.ndarray | None], list[Problem]]:
    """Find the bytes of every buffer (glTF 2.0, section 3.6.1).

    Returns:
        Bytes of each buffer, uint8, None for one that is not there, and the problems.
    """
    buffers: list[np.ndarray | None] = []
    problems = []
    for index, buffer in enumerate(document.json.get("buffers", [])):
        place = f"/buffers/{index}"
        found = _buffer_bytes(document, buffer, place)
        if isinstance(found, np.ndarray) and found.size < buffer["byteLength"]:
            expected = f"{buffer['byteLength']} bytes"
            found = Problem(place=place, expected=expected, found=f"{found.size} bytes")
        if isinstance(found, Problem):
            problems.append(found)
            buffers.append(None)
        else:
            buffers.append(found[: buffer["byteLength"]])
    return buffers, problems


def _buffer_bytes(
    document: GltfDocument, buffer: dict[str, Any], place: str
) -> np.ndarray | Problem:
    uri = buffer.get("uri")
    if uri is None:
        if document.blob is None:
            return Problem(place=place, expected="a uri or a chunk BIN", found="neither")
        return document.blob
    if uri.startswith(_DATA_URI):
        try:
            decoded = base64.b64decode(uri.partition(",")[2], validate=True)
        except (binascii.Error, ValueError) as error:
            return Problem(place=f"{place}/uri", expected="base64", found=str(error))
        return np.frombuffer(decoded, np.uint8)
    name = PurePosixPath(unquote(uri))
    shown = repr(uri[:80])
    if name.is_absolute() or ".." in name.parts or ":" in name.parts[0] or "\0" in str(name):
        expected = "a path in the folder of the file"
        return Problem(place=f"{place}/uri", expected=expected, found=shown)
    try:
        return _mapped(document.path.parent / name)
    except OSError as error:
        found = f"{shown}: {error.strerror or error}"
        return Problem(place=f"{place}/uri", expected="a file that can be read", found=found)


def _mapped(path: Path) -> np.ndarray:
    if path.stat().st_size == 0:
        return np.zeros(0, np.uint8)
    return np.memmap(path, np.uint8, mode="r")


def _chunks(data: np.ndarray) -> Iterator[tuple[bytes, np.ndarray]]:
    position = HEADER.size
    while position < data.size:
        size, kind = CHUNK.unpack(bytes(data[position : position + CHUNK.size]))
        position += CHUNK.size
        yield kind, data[position : position + size]
        position += size


def _parsed(path: Path, text: bytes, blob: np.ndarray | None) -> GltfDocument | list[Problem]:
    try:
        document = json.loads(text.decode("utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        return [Problem(place="JSON", expected="JSON in UTF-8 (RFC 8259)", found=str(error)[:200])]
    if not isinstance(document, dict):
        found = type(document).__name__
        return [Problem(place="JSON", expected="an object", found=found)]
    return GltfDocument(json=document, path=path, blob=blob)


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant}, which JSON does not know")
