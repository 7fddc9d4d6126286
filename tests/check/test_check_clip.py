"""Our own clip file, taken for anybody's."""

import dataclasses
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from exporters import save_clip
from exporters.check import check_file
from exporters.clip import Clip
from tests.helpers import clips


def rewrite(
    path: Path, *, name: str, content: bytes, compression: int = zipfile.ZIP_STORED
) -> None:
    """Put another content in place of one entry."""
    with zipfile.ZipFile(path) as archive:
        entries = {entry: archive.read(entry) for entry in archive.namelist()}
    entries[name] = content
    with zipfile.ZipFile(path, "w", compression) as archive:
        for entry, data in entries.items():
            archive.writestr(entry, data)


def npy(array: np.ndarray, **header: object) -> bytes:
    """Return a .npy whose header may promise something else."""
    stream = io.BytesIO()
    described = {"descr": array.dtype.str, "fortran_order": False, "shape": array.shape} | header
    np.lib.format.write_array_header_1_0(stream, described)
    return stream.getvalue() + array.tobytes()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    save_clip(clips.chain(), tmp_path / "clip.splatimate.npz")
    assert check_file(tmp_path / "clip.splatimate.npz") == ()
    return tmp_path / "clip.splatimate.npz"


def said(path: Path) -> list[str]:
    return [str(problem) for problem in check_file(path)]


def test_a_broken_promise_is_caught(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clip = clips.chain()
    scales = clip.splats.scales.copy()
    scales[1] = -3.5
    broken = dataclasses.replace(
        clip, splats=dataclasses.replace(clip.splats, scales=scales), fps=0.0
    )
    with monkeypatch.context() as patch:
        patch.setattr(Clip, "validate", lambda self: None)
        save_clip(broken, path)
    assert said(path) == [
        "fps: expected a positive number, found 0.0",
        "splats.scales: expected a clip that keeps its promises, found 1 Gaussians with a scale <= 0 "
        "(first at 1)",
    ]


def test_an_array_that_promises_more_than_it_holds_is_not_read(path: Path) -> None:
    content = npy(np.zeros(3, np.float32), shape=(10**12, 4))
    rewrite(path, name="splats.opacities.npy", content=content)
    (line,) = said(path)
    assert line.startswith(
        "splats.opacities.npy: expected float32 of shape (1000000000000, 4), 16000"
    )


def test_compressed_data_is_not_read(path: Path) -> None:
    rewrite(path, name="bomb.npy", content=bytes(10**6), compression=zipfile.ZIP_DEFLATED)
    assert "bomb.npy: expected an array, stored, found compressed data" in said(path)


def test_objects_are_not_read(path: Path) -> None:
    content = npy(np.zeros(1, np.uint64), descr="|O")
    rewrite(path, name="splats.opacities.npy", content=content)
    assert said(path)[0].startswith("splats.opacities.npy: expected object")


@pytest.mark.parametrize("content", [b"", b"no array", b"\x93NUMPY\x01\x00\xff\xff"])
def test_an_entry_that_is_no_array_is_caught(content: bytes, path: Path) -> None:
    rewrite(path, name="splats.opacities.npy", content=content)
    assert said(path)[0].startswith("splats.opacities.npy: expected a numpy array")


def test_a_damaged_archive_is_caught(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-30])
    assert said(path)[0].startswith("archive: expected a zip of numpy arrays")


def test_a_foreign_archive_is_caught(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.splatimate.npz", a=np.zeros(3))
    assert said(tmp_path / "x.splatimate.npz")[0].startswith(
        "clip: expected a clip, found not a clip"
    )
