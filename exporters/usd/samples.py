"""Time samples of large arrays, written as fast as the disk takes them, with flat memory.

Through `Set` and `Save` alone every number is converted one by one, hashed and copied: six times as
long as writing the bytes. So USD writes the whole file with an array of one element in place of
each large one; the large ones are then appended to the file, and its references moved to them.

This is how a binary USD file holds an array (`Sdf_CrateValueRep` in pxr/usd/sdf/crateFile.h; AOUSD
Core Specification 1.0, section 16.3): somewhere in the file lie its length, uint64, and its
elements as in memory; a reference of 64 bits holds that offset (48 bits), the element type (8) and
flags. The references of an attribute's samples lie in one run, in the order of time. Behind all
arrays lie the sections that describe the scene, where USD puts what it saves next, and a table of
them, which the head of the file points at: so they are moved behind the appended arrays.

Where a file does not look like that, a text file or one of a later USD, USD writes it all.
"""

import contextlib
import dataclasses
import mmap
import os
import struct
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from pxr import Usd, Vt

_ELEMENT_TYPES = {
    Vt.QuatfArray: 17,
    Vt.QuathArray: 18,
    Vt.Vec3fArray: 24,
    Vt.Vec3hArray: 25,
}  # of the file format, `Sdf_CrateTypeEnum`

_IS_ARRAY = 1 << 63
_ALIGNMENT_BYTES = 8  # USD reads aligned arrays in place
_TABLE_POINTER_OFFSET = 16  # after `PXR-USDC` and eight bytes of version
_INTEGER = struct.Struct("<q")
_SECTION = struct.Struct("<16sqq")  # name, offset, size

_STEP = 1000  # half floats hold whole numbers up to 2048 exactly


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SampledArray:
    """An attribute that gets one large array at every time code."""

    attribute: Usd.Attribute
    array_type: Any
    """Its class in Vt, one of those of `_ELEMENT_TYPES`."""


WriteSamples = Callable[..., None]
"""Takes one array of rows for each attribute, as USD lays them out in memory."""


@contextlib.contextmanager
def writing_samples(
    stage: Usd.Stage, arrays: Sequence[SampledArray], codes: Sequence[int]
) -> Iterator[WriteSamples]:
    """Yield what writes the samples of the next time code; it must be called once for each.

    Prims found before the block may have expired after it: the file is read again.

    Args:
        stage: A stage on a file. What is in it so far is saved.
        arrays: The attributes.
        codes: Increasing time codes.
    """
    layer = stage.GetRootLayer()
    is_binary = Path(layer.realPath).suffix.lower() != ".usda"
    runs = _reserve(stage, arrays, codes) if is_binary else None
    if runs is None:
        yield _Setter(stage, arrays, codes, saves=is_binary).write
        return
    with Path(layer.realPath).open("r+b") as file:
        appender = _Appender(file, runs)
        yield appender.write
        appender.finish()
    layer.Reload(force=True)


class _Setter:
    """Leaves it all to USD; a binary file is saved at every code, so that memory stays flat."""

    def __init__(
        self, stage: Usd.Stage, arrays: Sequence[SampledArray], codes: Sequence[int], *, saves: bool
    ) -> None:
        self._stage, self._arrays, self._saves = stage, arrays, saves
        self._codes = iter(codes)

    def write(self, *rows_of_arrays: np.ndarray) -> None:
        code = next(self._codes)
        for array, rows in zip(self._arrays, rows_of_arrays, strict=True):
            array.attribute.Set(array.array_type.FromNumpy(np.ascontiguousarray(rows)), code)
        if self._saves:
            self._stage.Save()


@dataclasses.dataclass(eq=False)
class _Run:
    """The references of one attribute's samples in a file."""

    offset: int
    type_bits: int
    moved: list[int] = dataclasses.field(default_factory=list)


class _Appender:
    """Appends arrays to a file, and moves its references to them in the end."""

    def __init__(self, file: BinaryIO, runs: list[_Run]) -> None:
        self._file, self._runs = file, runs
        self._end = file.seek(0, os.SEEK_END)

    def write(self, *rows_of_arrays: np.ndarray) -> None:
        for run, rows in zip(self._runs, rows_of_arrays, strict=True):
            padding = -self._end % _ALIGNMENT_BYTES
            run.moved.append(run.type_bits | (self._end + padding))
            self._file.write(bytes(padding) + _INTEGER.pack(len(rows)))
            self._file.write(np.ascontiguousarray(rows).data)
            self._end += padding + 8 + rows.nbytes

    def finish(self) -> None:
        for run in self._runs:
            self._file.seek(run.offset)
            self._file.write(np.array(run.moved, dtype="<u8").tobytes())
        self._move_sections()

    def _move_sections(self) -> None:
        """Copy the sections and their table to the end, and let the head point there."""
        self._file.seek(_TABLE_POINTER_OFFSET)
        (table_offset,) = _INTEGER.unpack(self._file.read(_INTEGER.size))
        self._file.seek(table_offset)
        (count,) = _INTEGER.unpack(self._file.read(_INTEGER.size))
        sections = [_SECTION.unpack(self._file.read(_SECTION.size)) for _ in range(count)]
        table = _INTEGER.pack(count)
        for name, offset, size in sections:
            self._file.seek(offset)
            content = self._file.read(size)
            table += _SECTION.pack(name, self._file.seek(0, os.SEEK_END), size)
            self._file.write(content)
        table_offset = self._file.seek(0, os.SEEK_END)
        self._file.write(table)
        self._file.seek(_TABLE_POINTER_OFFSET)
        self._file.write(_INTEGER.pack(table_offset))


def _reserve(
    stage: Usd.Stage, arrays: Sequence[SampledArray], codes: Sequence[int]
) -> list[_Run] | None:
    """Save one-element arrays in place of all samples; return where their references lie, if found."""
    markers = []
    for array in arrays:
        template = np.asarray(array.array_type(1))
        first = len(markers) * len(codes)
        markers.append([_marker(template, first + index) for index in range(len(codes))])
        for code, marker in zip(codes, markers[-1], strict=True):
            array.attribute.Set(array.array_type.FromNumpy(marker), code)
    stage.Save()
    with (
        Path(stage.GetRootLayer().realPath).open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
    ):
        found = [_find_run(content, *pair) for pair in zip(arrays, markers, strict=True)]
    runs = [run for run in found if run is not None]
    return runs if len(runs) == len(arrays) else None


def _find_run(content: mmap.mmap, array: SampledArray, markers: list[np.ndarray]) -> _Run | None:
    """Return where the references to these arrays lie, None if the file has no such run.

    What was saved last lies near the end, hence the search from there.
    """
    type_bits = _IS_ARRAY | _ELEMENT_TYPES[array.array_type] << 48
    references = bytearray()
    found = content.rfind(_stored(markers[0]))
    for marker in markers:
        found = content.find(_stored(marker), max(found, 0))
        if found < 0:
            return None
        references += struct.pack("<Q", type_bits | found)
    offset = content.rfind(references)
    return _Run(offset=offset, type_bits=type_bits) if offset >= 0 else None


def _stored(rows: np.ndarray) -> bytes:
    return _INTEGER.pack(len(rows)) + rows.tobytes()


def _marker(template: np.ndarray, number: int) -> np.ndarray:
    """Return one element unlike any other's: numbers that are exact in half floats, too."""
    row = np.full_like(template, 7)
    row[0, :2] = number % _STEP + 1, number // _STEP + 1
    return row
