"""Each rule for PLY catches a file, or a folder, broken in that one way."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from exporters import export_clip
from exporters.check import check_file
from tests.helpers import clips

COLUMNS = 62  # x y z, normals, 3 + 45 harmonics, opacity, 3 scales, 4 rotations
ROWS = 8


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    export_clip(clips.random(gaussians=ROWS, keys=3), tmp_path / "clip_gaussians")
    assert check_file(tmp_path / "clip_gaussians") == ()
    return tmp_path / "clip_gaussians"


def edit_rows(path: Path, change: Callable[[np.ndarray], None]) -> None:
    head, end, body = path.read_bytes().partition(b"end_header\n")
    rows = np.frombuffer(body, "<f4").reshape(ROWS, COLUMNS).copy()
    change(rows)
    path.write_bytes(head + end + rows.tobytes())


def in_header(old: bytes, new: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(path.read_bytes().replace(old, new, 1))


def in_rows(index: object, value: object) -> Callable[[Path], None]:
    return lambda path: edit_rows(path, lambda rows: rows.__setitem__(index, value))


EDITS = {
    "no PLY": (in_header(b"ply", b"plx"), "header: expected `ply`, `format binary_little_endian"),
    "byte order": (in_header(b"little", b"big"), "header: expected `ply`"),
    "no end": (
        in_header(b"end_header", b"end_heade"),
        "header: expected `ply`, `format binary_little_endian 1.0`, ..., `end_header`",
    ),
    "count": (
        in_header(b"vertex 8", b"vertex 9"),
        "rows: expected 9 rows of 62 floats, ",
    ),
    "huge count": (
        in_header(b"vertex 8", b"vertex 999999999999999"),
        "rows: expected 999999999999999 rows",
    ),
    "no rows": (in_header(b"vertex 8", b"vertex 0"), "header: expected one element, `vertex`"),
    "doubles": (in_header(b"float x", b"double x"), "header: expected one element, `vertex`"),
    "missing": (
        in_header(b"opacity", b"opacitx"),
        "header: expected the properties x, y, z, f_dc_0, f_dc_1, f_dc_2, opacity, scale_0, scale_1, "
        "scale_2, rot_0, rot_1, rot_2, rot_3, found no opacity",
    ),
    "twice": (
        in_header(b"float nx", b"float ny"),
        "header: expected each property once, found more of ny",
    ),
    "gap": (
        in_header(b"f_rest_44", b"f_rest_45"),
        "header: expected f_rest_0, f_rest_1, ..., (0, 9, 24, 45)",
    ),
    "cut off": (lambda path: path.write_bytes(path.read_bytes()[:-1]), "rows: expected 8 rows"),
    "not finite": (
        in_rows((3, 6), np.inf),
        "f_dc_0 of row 3: expected finite numbers, found 1 numbers in the file that are not",
    ),
    "zero rotation": (
        in_rows((2, slice(-4, None)), 0.0),
        "rot_0..3: expected rotations that can be normalized, found 1 Gaussians whose quaternion is zero "
        "(first at 2)",
    ),
}


@pytest.mark.parametrize("mistake", EDITS)
def test_a_broken_frame_is_caught_alone_and_in_its_folder(mistake: str, folder: Path) -> None:
    edit, expected = EDITS[mistake]
    edit(folder / "clip_0001.ply")
    for path in (folder, folder / "clip_0001.ply"):
        said = [str(problem) for problem in check_file(path)]
        assert any(line.startswith(f"clip_0001.ply: {expected}") for line in said), said


def test_rotations_of_a_single_file_may_have_any_length(folder: Path) -> None:
    edit_rows(folder / "clip_0000.ply", lambda rows: rows[:, -4:].__imul__(np.float32(7)))
    assert check_file(folder / "clip_0000.ply") == ()


def test_a_sign_jump_between_frames_is_caught(folder: Path) -> None:
    edit_rows(folder / "clip_0001.ply", lambda rows: rows[5, -4:].__imul__(np.float32(-1)))
    said = [str(problem) for problem in check_file(folder)]
    assert [line.split(": expected")[0] for line in said] == [
        "clip_0001.ply: rot_0..3",
        "clip_0002.ply: rot_0..3",
    ]


def test_a_missing_frame_is_caught(folder: Path) -> None:
    (folder / "clip_0001.ply").unlink()
    (problem,) = check_file(folder)
    assert str(problem) == (
        "folder: frame 1: expected frames numbered 0, 1, ... without gaps, found 2 in its place"
    )


@pytest.mark.parametrize("name", ["other_0000.ply", "clip.ply"])
def test_a_stranger_is_caught(name: str, folder: Path) -> None:
    (folder / name).write_bytes((folder / "clip_0000.ply").read_bytes())
    problems = check_file(folder)
    assert problems[0].place == "folder"
    assert problems[0].expected.startswith("files named by one prefix and a number")


def test_a_frame_of_another_count_is_caught(folder: Path, tmp_path: Path) -> None:
    export_clip(clips.random(gaussians=ROWS + 1), tmp_path / "more_gaussians")
    frame = (tmp_path / "more_gaussians" / "clip_0000.ply").read_bytes()
    (folder / "clip_0001.ply").write_bytes(frame)
    (problem,) = check_file(folder)
    assert str(problem).startswith(
        "clip_0001.ply: header: expected 8 rows of 62 columns as in the first file, found 9 rows of 62"
    )
