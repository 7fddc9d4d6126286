"""Rules for splats as PLY: one file, or a folder of one file a frame.

Layout: http://paulbourke.net/dataformats/ply/ and the INRIA trainer's `save_ply`.
"""

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from exporters.check import numbers
from exporters.check.problem import Problem, count_bad

MAX_HEADER_BYTES = 2**16
REST_COUNTS = (0, 9, 24, 45)
"""Numbers of `f_rest_*` columns: three channels of (d + 1)^2 - 1 coefficients, degree d 0..3."""

ROTATIONS = tuple(f"rot_{i}" for i in range(4))
REQUIRED = (
    *("x", "y", "z"),
    *(f"f_dc_{i}" for i in range(3)),
    "opacity",
    *(f"scale_{i}" for i in range(3)),
    *ROTATIONS,
)

SMALLEST_SQUARE = 1e-12
"""Squared length of a quaternion below which its direction is noise."""

_MAGIC = ("ply", "format binary_little_endian 1.0")
_FRAME_NAME = re.compile(r"(?P<prefix>.*?)(?P<number>\d+)\.ply", re.IGNORECASE | re.DOTALL)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlyHeader:
    """What the header of a PLY file says."""

    count: int
    """Number of rows."""
    columns: tuple[str, ...]
    """Names of the float properties."""
    size_bytes: int
    """Where the rows begin."""


def check_ply(path: Path) -> Iterator[Problem]:
    """Check one file of Gaussians."""
    header, problems = read_header(path.name, path)
    yield from problems
    if header is not None:
        rows = _rows(path, header)
        yield from finite_rows(path.name, header, rows)
        yield from rotation_problems(path.name, _rotations(header, rows))


def check_sequence(folder: Path) -> Iterator[Problem]:
    """Check a folder of one file a frame, one frame in memory at a time."""
    frames = sorted(
        (path for path in folder.iterdir() if path.suffix.lower() == ".ply"),
        key=lambda path: (len(path.name), path.name),
    )
    yield from numbering([path.name for path in frames])
    first: PlyHeader | None = None
    rotations: np.ndarray | None = None
    for path in frames:
        header, problems = read_header(path.name, path)
        yield from problems
        if header is None:
            rotations = None
            continue
        rows = _rows(path, header)
        yield from finite_rows(path.name, header, rows)
        first = first or header
        if (header.count, header.columns) != (first.count, first.columns):
            yield Problem(
                place=f"{path.name}: header",
                expected=f"{first.count} rows of {len(first.columns)} columns as in the first file",
                found=f"{header.count} rows of {len(header.columns)}, or other columns",
            )
            rotations = None
            continue
        previous, rotations = rotations, _rotations(header, rows)
        yield from rotation_problems(path.name, rotations)
        if previous is not None:
            yield from numbers.continuous_signs(f"{path.name}: rot_0..3", previous, rotations)


def read_header(place: str, path: Path) -> tuple[PlyHeader | None, list[Problem]]:
    """Read and check a header against the size of the file, before any row is read.

    Returns:
        The header, or None if the rows cannot be found, and the problems.
    """
    with path.open("rb") as stream:
        start = stream.read(MAX_HEADER_BYTES)
    text, end, _ = start.partition(b"\nend_header\n")
    lines = text.decode("ascii", errors="replace").splitlines()
    if not end or tuple(lines[:2]) != _MAGIC:
        expected = f"`{_MAGIC[0]}`, `{_MAGIC[1]}`, ..., `end_header`, as splat viewers read it"
        found = "no end_header" if not end else repr(" ".join(lines[:2])[:60])
        return None, [Problem(place=f"{place}: header", expected=expected, found=found)]
    counts = [line.split()[2] for line in lines if re.fullmatch("element vertex [0-9]{1,18}", line)]
    columns = tuple(line.split()[2] for line in lines if re.fullmatch(r"property float \S+", line))
    plain = 2 + len(counts) + len(columns) + sum(line.startswith("comment") for line in lines)
    if len(counts) != 1 or plain != len(lines) or int(counts[0]) == 0 or not columns:
        expected = "one element, `vertex`, with at least one row of `property float` columns"
        found = f"{len(lines) - plain} other lines, vertex counts {counts}"
        return None, [Problem(place=f"{place}: header", expected=expected, found=found)]
    header = PlyHeader(count=int(counts[0]), columns=columns, size_bytes=len(text) + len(end))
    problems = [*column_problems(f"{place}: header", columns)]
    expected_bytes = header.size_bytes + 4 * header.count * len(columns)
    if path.stat().st_size != expected_bytes:
        problems.append(
            Problem(
                place=f"{place}: rows",
                expected=f"{header.count} rows of {len(columns)} floats, {expected_bytes} bytes",
                found=f"{path.stat().st_size} bytes",
            )
        )
        return None, problems
    return header, problems


def column_problems(place: str, columns: tuple[str, ...]) -> Iterator[Problem]:
    """Every column that splat viewers read is there, once (INRIA `save_ply`)."""
    missing = [name for name in REQUIRED if name not in columns]
    if missing:
        yield Problem(
            place=place,
            expected=f"the properties {', '.join(REQUIRED)}",
            found=f"no {', '.join(missing)}",
        )
    if len(set(columns)) < len(columns):
        repeated = sorted({name for name in columns if columns.count(name) > 1})
        yield Problem(
            place=place, expected="each property once", found=f"more of {', '.join(repeated)}"
        )
    rest = [name for name in columns if name.startswith("f_rest_")]
    if len(rest) not in REST_COUNTS or set(rest) != {f"f_rest_{i}" for i in range(len(rest))}:
        yield Problem(
            place=place,
            expected=f"f_rest_0, f_rest_1, ..., {REST_COUNTS} of them for SH degree 0 to 3",
            found=f"{len(rest)}, or gaps between them",
        )


def finite_rows(place: str, header: PlyHeader, rows: np.ndarray) -> Iterator[Problem]:
    """Every number is finite.

    Args:
        place: Which file.
        header: Of the file.
        rows: Shape (N, columns).
    """
    is_bad = ~np.isfinite(rows)
    if is_bad.any():
        row, column = np.unravel_index(int(np.argmax(is_bad)), is_bad.shape)
        yield Problem(
            place=f"{place}: {header.columns[column]} of row {row}",
            expected="finite numbers",
            found=f"{np.count_nonzero(is_bad)} numbers in the file that are not",
        )


def rotation_problems(place: str, quats_wxyz: np.ndarray) -> Iterator[Problem]:
    """Every rotation can be normalized, as every reader of INRIA's layout does.

    Args:
        place: Which file.
        quats_wxyz: Shape (N, 4).
    """
    yield from count_bad(
        f"{place}: rot_0..3",
        np.einsum("ni,ni->n", quats_wxyz, quats_wxyz) < SMALLEST_SQUARE,
        expected="rotations that can be normalized",
        what="Gaussians whose quaternion is zero",
    )


def numbering(names: list[str]) -> Iterator[Problem]:
    """Frames are numbered 0, 1, ... after one prefix: importers take the number for the time code.

    Args:
        names: File names in the order of their numbers.
    """
    matches = [match for match in map(_FRAME_NAME.fullmatch, names) if match]
    prefixes = {match["prefix"] for match in matches}
    if len(matches) < len(names) or len(prefixes) != 1:
        yield Problem(
            place="folder",
            expected="files named by one prefix and a number, such as clip_0000.ply",
            found=f"{len(names)} PLY files, {len(names) - len(matches)} without a number, "
            f"{len(prefixes)} prefixes",
        )
        return
    found = sorted(int(match["number"]) for match in matches)
    for expected, number in enumerate(found):
        if number != expected:
            yield Problem(
                place=f"folder: frame {expected}",
                expected="frames numbered 0, 1, ... without gaps",
                found=f"{number} in its place",
            )
            return


def _rows(path: Path, header: PlyHeader) -> np.ndarray:
    shape = (header.count, len(header.columns))
    return np.memmap(path, dtype="<f4", mode="r", offset=header.size_bytes, shape=shape)


def _rotations(header: PlyHeader, rows: np.ndarray) -> np.ndarray:
    """Return the quaternions in memory, wxyz, shape (N, 4); no rows if a column is missing."""
    if not set(ROTATIONS) <= set(header.columns):
        return np.zeros((0, 4), np.float32)
    return np.stack([rows[:, header.columns.index(name)] for name in ROTATIONS], axis=1)
