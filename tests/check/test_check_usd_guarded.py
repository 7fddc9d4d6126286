"""Files that are no stage, and those that bring USD down, are problems like any other."""

import subprocess
import sys
from pathlib import Path

import pytest

from exporters.check import check_file
from exporters.check.usd import guarded
from tests.check.usd_edits import good_usda


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return good_usda(tmp_path / "good.usda")


@pytest.mark.parametrize("content", [b"", b"#usda 1.0\n(", b"PXR-USDC" + b"x" * 200, b"\xff\xfe"])
def test_no_stage_at_all_is_a_problem(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "clip.usd").write_bytes(content)
    (problem,) = check_file(tmp_path / "clip.usd", is_trusted=True)
    assert str(problem).startswith("stage: expected a file that USD can read, found ")


def test_a_foreign_file_is_read_in_another_process(good: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip.usda"
    path.write_text(good.read_text().replace("metersPerUnit = 1", ""))
    assert check_file(path) == check_file(path, is_trusted=True) != ()


def test_a_crash_of_usd_is_a_problem(
    good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dies = [sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"]
    run = subprocess.run
    monkeypatch.setattr(guarded.subprocess, "run", lambda command, **options: run(dies, **options))
    (problem,) = check_file(good)
    assert str(problem) == (
        "stage: expected a file that USD can read, found one it dies of (Segmentation fault)"
    )
