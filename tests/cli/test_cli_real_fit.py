"""The whole tool on a tiny scene: nothing replaced."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from animator.cli import animate_main
from animator.commands.progress_file import ProgressFile

FLAGS = ("--matcher", "flow", "--iterations", "3", "--anchors", "12", "--device", "cpu", "-q")


@pytest.fixture
def scene(scene: Path) -> Path:
    """Move the object by a pixel a frame: frames that show nothing new would not be solved."""
    for number, path in enumerate(sorted((scene / "frames").iterdir())):
        Image.fromarray(np.roll(np.asarray(Image.open(path)), number, axis=1)).save(path)
    return scene


def run(scene: Path, out: Path, *flags: str) -> int:
    out.mkdir(exist_ok=True)
    outs = ("--out", str(out / "cube.usdc"), "--out", str(out / "cube.glb"))
    return animate_main([str(scene / "frames"), *outs, *FLAGS, *flags])


def digests_in(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file() and "_report." not in path.name  # reports hold wall times
    }


def test_a_killed_run_resumes_to_the_same_bytes(scene, tmp_path, monkeypatch):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert run(scene, whole) == 0
    summary = json.loads((whole / "cube_report.json").read_text())["summary"]
    assert summary["mean_silhouette_iou"] > 0.9
    assert summary["largest_skin_error_percent"] < 1e-3

    keep = ProgressFile.keep

    def keep_and_die(self, index, solved):
        keep(self, index, solved)
        if index == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(ProgressFile, "keep", keep_and_die)
    assert run(scene, broken) == 130
    assert [path.name for path in broken.iterdir()] == ["cube.progress.npz"]
    monkeypatch.setattr(ProgressFile, "keep", keep)
    assert run(scene, broken, "--resume") == 0
    assert digests_in(broken) == digests_in(whole)


@pytest.mark.parametrize("flag", ["--no-deform", "--no-group", "--no-region-growing"])
def test_ablations_run(scene, tmp_path, flag):
    assert run(scene, tmp_path / "out", flag, "--frames", "0,1", "--cache", "none") == 0
