import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from animator.cli import animate_main, main
from exporters import save_clip
from exporters.ply import layout, sequence
from tests.helpers import clips

ROOT = Path(__file__).parents[2]
CHECK_IMPORTS = """
import sys
from animator.cli import main
code = main(sys.argv[1:])
heavy = sorted({"torch", "cv2", "numba", "pxr", "pygltflib"} & set(sys.modules))
sys.exit(f"imported {heavy}" if heavy else code)
"""


@pytest.fixture
def ply(tmp_path: Path) -> Path:
    clip = clips.random(gaussians=8)
    path = tmp_path / "lamp.ply"
    path.write_bytes(layout.header(8, 16) + layout.rest_rows(clip).tobytes())
    return path


@pytest.fixture
def broken(ply: Path) -> Path:
    path = ply.with_name("broken.ply")
    path.write_bytes(ply.read_bytes()[:-4])
    return path


def test_a_good_file_ends_with_0_and_says_nothing_on_stdout(ply, capsys):
    assert main(["check", str(ply)]) == 0
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == f"{ply}: no problem found.\n"
    assert main(["check", str(ply), "-q"]) == 0
    assert capsys.readouterr().err == ""


def test_problems_end_with_5_and_are_listed_on_stdout(ply, broken, capsys):
    assert main(["check", str(broken), str(ply)]) == 5
    told = capsys.readouterr()
    assert told.out.startswith(f"{broken}: broken.ply: rows: expected 8 rows of 62 floats")
    assert told.out.count("\n") == 1
    assert f"{ply}: no problem" in told.err


@pytest.mark.parametrize("name", ["missing.glb", "notes.txt", "empty"])
def test_what_cannot_be_checked_ends_with_3_and_the_others_are_checked(name, broken, capsys):
    (broken.parent / "notes.txt").write_text("no asset")
    (broken.parent / "empty").mkdir()
    assert main(["check", str(broken.parent / name), str(broken)]) == 3
    told = capsys.readouterr()
    assert name in told.err
    assert "broken.ply: rows" in told.out


def test_no_file_is_a_usage_error():
    with pytest.raises(SystemExit) as caught:
        main(["check"])
    assert caught.value.code == 2


def test_check_imports_no_heavy_package(ply):
    finished = subprocess.run(
        [sys.executable, "-c", CHECK_IMPORTS, "check", str(ply)], cwd=ROOT, check=False
    )
    assert finished.returncode == 0


@pytest.fixture
def a_writer_that_errs(monkeypatch):
    """Let PLY files have a number that is none."""

    def rest_rows(clip):
        rows = right_rows(clip)
        rows[1, 6] = np.nan
        return rows

    right_rows = layout.rest_rows
    monkeypatch.setattr(sequence.layout, "rest_rows", rest_rows)


def test_export_checks_what_it_wrote(tmp_path, a_writer_that_errs, capsys):
    save_clip(clips.chain(), tmp_path / "clip.splatimate.npz")
    command = ["export", str(tmp_path / "clip.splatimate.npz"), "--out", str(tmp_path / "x.glb")]
    assert main([*command, "--cache", "ply", "-q"]) == 5
    told = capsys.readouterr().err
    assert "x_gaussians breaks 4 rules of its format" in told
    assert "clip_0003.ply: f_dc_0 of row 1: expected finite numbers" in told
    # Everything stays: it may be looked at.
    assert (tmp_path / "x.glb").exists()
    assert (tmp_path / "x_gaussians" / "clip_0003.ply").exists()


def test_a_long_list_is_cut(tmp_path, a_writer_that_errs, capsys):
    clip = clips.random(gaussians=8, keys=20)
    save_clip(clip, tmp_path / "clip.splatimate.npz")
    command = ["export", str(tmp_path / "clip.splatimate.npz"), "--out", str(tmp_path / "x.glb")]
    assert main([*command, "--cache", "ply", "-q"]) == 5
    told = capsys.readouterr().err
    assert "more; `splatimate check" in told
    assert told.count("f_dc_0 of row 1") == 20


def test_animate_reports_before_it_ends_with_5(
    scene, stub_fit, a_writer_that_errs, tmp_path, capsys
):
    out = tmp_path / "out" / "clip.glb"
    command = [str(scene / "frames"), "--out", str(out), "--cache", "ply", "--min-iou", "0"]
    assert animate_main(command) == 5
    assert "clip_gaussians breaks" in capsys.readouterr().err
    assert (tmp_path / "out" / "clip_report.html").exists()
