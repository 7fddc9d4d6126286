"""The command on a tiny scene, with real fits of few steps."""

import dataclasses
import json
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from animator import cli
from animator.evaluation import fits
from animator.evaluation.figures import FIGURES
from exporters import load_clip, save_clip

FAST = ("--iterations", "2", "--anchors", "8", "--matcher", "flow", "--device", "cpu", "-q")


def evaluate(*arguments: str | Path) -> int:
    return cli.main(["evaluate", *map(str, arguments), *FAST])


def table(out: Path, task: str = "clip") -> dict:
    return json.loads((out / f"{task}.json").read_text())


def by_method(out: Path, task: str = "clip") -> dict[str, dict]:
    return {row["method"]: row for row in table(out, task)["results"]}


@pytest.fixture(scope="module")
def done(master_scene, tmp_path_factory) -> Path:
    """Two frames of the model at rest and of ours, scored."""
    out = tmp_path_factory.mktemp("scores")
    assert evaluate(master_scene, "--out", out, "--frames", "0,2") == 0
    return out


def test_the_model_at_rest_captures_nothing_and_ours_something(done):
    rows = by_method(done)
    assert list(rows) == ["static", "full"]
    still = rows["static"]
    assert still["captured"] == still["captured_seen"] == still["captured_unseen"] == 0
    assert still["rigid_error_percent"] == pytest.approx(0, abs=1e-4)
    # Frame 2 of a slide by .0632 a frame; the box's diagonal is 1.7205.
    assert still["epe_percent"] == pytest.approx(100 * 2 * np.hypot(0.06, 0.02) / 1.72, rel=0.01)
    assert still["depth_percent"] < 0.2 * still["lateral_percent"]
    assert still["seconds_per_frame"] is None
    ours = rows["full"]
    assert ours["captured"] > 0.3
    assert ours["front_psnr_db"] > still["front_psnr_db"]
    assert ours["seconds_per_frame"] > 0


def test_json_holds_every_figure_frame_part_and_view(done):
    document = table(done)
    assert document["format"] == "splatimate-evaluation"
    assert document["task"] == "clip"
    for row in document["results"]:
        assert set(FIGURES) <= set(row)
        assert row["scored_frames"] == [2]
        assert [frame["number"] for frame in row["frames"]] == [2]
        assert [part["name"] for part in row["parts"]] == ["left", "right"]
        assert [(view["number"], view["view"]) for view in row["views"]] == [
            (2, "front"),
            (2, "side"),
        ]
        assert row["psnr_db"] == row["views"][1]["scores"]["psnr_db"]
        assert row["lpips"] is None
    assert document["means"]["full"]["captured"] == document["results"][1]["captured"]
    assert document["means"]["full"]["scenes"] == 1


def test_markdown_shows_the_same(done):
    text = (done / "clip.md").read_text()
    assert text.startswith("# clip: all frames")
    lines = text.splitlines()
    assert "LPIPS" not in lines[2]
    heads = [cell.strip() for cell in lines[2].strip("|").split("|")]
    for line, (name, row) in zip(lines[4:6], by_method(done).items(), strict=True):
        cells = dict(zip(heads, (c.strip() for c in line.strip("|").split("|")), strict=True))
        assert (cells["scene"], cells["method"]) == ("box", name)
        assert cells["captured"] == f"{row['captured']:.3f}"
        assert cells["PSNR"] == f"{row['psnr_db']:.2f}"
    assert "## Parts of box, full" in text


def test_there_are_pictures_and_a_plot(done):
    for method in ("static", "full"):
        with Image.open(done / "box" / method / "pictures.png") as sheet:
            assert sheet.width > 6 * 100
    plot = ElementTree.parse(done / "box" / "clip_errors.svg").getroot()
    lines = plot.findall("{http://www.w3.org/2000/svg}polyline")
    assert len(lines) == 4  # two methods, total and depth


def test_what_is_there_is_not_fitted_again(done, master_scene, tmp_path, monkeypatch):
    before = by_method(done)["full"]
    kept = shutil.copytree(done, tmp_path / "kept")

    def forbidden(*arguments, **options):
        raise AssertionError("fitted again")

    monkeypatch.setattr(fits, "fit", forbidden)
    flags = (master_scene, "--out", kept, "--frames", "0,2", "--methods", "full")
    assert evaluate(*flags) == 0
    after = by_method(kept)["full"]
    # The time of the fit is kept to fewer digits than it was measured with.
    seconds = [figures.pop("seconds_per_frame") for figures in (before, after)]
    assert seconds[1] == pytest.approx(seconds[0], abs=1e-3)
    assert after == before
    # Another choice asks for another result.
    assert evaluate(*flags, "--seed", "1") == cli.ExitCode.BUG


def test_an_interrupted_fit_goes_on_where_it_stopped(master_scene, tmp_path, monkeypatch):
    flags = (master_scene, "--out", tmp_path, "--frames", "0,1,2", "--methods", "full")
    real = fits.fit

    def fit_and_note(*arguments, **options):
        resumed.append(len(options["resume_from"]))
        if not resumed[1:]:
            keep = options["on_frame"]

            def keep_and_die(index, frame):
                keep(index, frame)
                if index == 1:
                    raise KeyboardInterrupt

            options["on_frame"] = keep_and_die
        return real(*arguments, **options)

    resumed: list[int] = []
    monkeypatch.setattr(fits, "fit", fit_and_note)
    assert evaluate(*flags) == 130
    assert evaluate(*flags) == 0
    assert resumed == [0, 2]
    assert not (tmp_path / "box" / "full" / "progress.npz").exists()


def test_a_clip_that_is_there_is_scored_without_fitting(done, master_scene, tmp_path):
    clip = str(done / "{scene}" / "full" / "clip.splatimate.npz")
    assert evaluate(master_scene, "--out", tmp_path, "--clip", clip) == 0
    scored, fitted = by_method(tmp_path)["clip"], by_method(done)["full"]
    for key in ("captured", "psnr_db", "rigid_error_percent", "frames"):
        assert scored[key] == fitted[key]


def test_a_folder_of_ply_files_is_scored_too(master_scene, tmp_path):
    cache = tmp_path / "cache"
    cache.mkdir()
    for number in range(4):
        (cache / f"any_{number}.ply").write_bytes((master_scene / "init.ply").read_bytes())
    assert evaluate(master_scene, "--out", tmp_path / "out", "--clip", cache) == 0
    assert by_method(tmp_path / "out")["clip"]["captured"] == 0
    (cache / "any_3.ply").unlink()
    assert evaluate(master_scene, "--out", tmp_path / "out", "--clip", cache) == 3


def test_in_betweens_are_scored_on_the_frames_left_out(master_scene, tmp_path):
    flags = ("--task", "interpolate2", "--methods", "static,full")
    assert evaluate(master_scene, "--out", tmp_path, *flags) == 0
    rows = by_method(tmp_path, "interpolate2")
    assert list(rows) == ["static", "full", "full-linear"]
    assert all(row["scored_frames"] == [1] for row in rows.values())
    clip = load_clip(tmp_path / "box" / "interpolate2-full" / "clip.splatimate.npz")
    assert clip.source_frames == (0, -1, 2)


def test_what_cannot_be_used_is_named(master_scene, tmp_path, capsys):
    out = tmp_path / "out"
    assert evaluate(master_scene, "--out", out, "--task", "half-views") == 3
    assert "init_half.ply" in capsys.readouterr().err
    assert evaluate(master_scene, "--out", out, "--task", "single", "--clip", "x.npz") == 3
    flags = ("--task", "interpolate2", "--methods", "rgb-only")
    assert evaluate(master_scene, "--out", out, *flags) == 3
    assert "in-betweens" in capsys.readouterr().err
    assert evaluate(master_scene, "--out", out, "--frame-camera", "a.json") == 3
    assert not out.exists()


def test_a_broken_scene_does_not_stop_the_others(master_scene, scene, tmp_path):
    broken = scene.parent / "broken"
    scene.rename(broken)
    (broken / "gt_points.npz").write_bytes(b"")
    flags = ("--methods", "static", "--out", tmp_path / "out")
    assert evaluate(broken, master_scene, *flags) == 3
    document = table(tmp_path / "out")
    assert [row["scene"] for row in document["results"]] == ["box"]
    assert document["notes"][0].startswith("broken: left out")


def test_a_clip_of_another_scene_is_refused(done, master_scene, tmp_path, capsys):
    clip = load_clip(done / "box" / "full" / "clip.splatimate.npz")
    path = tmp_path / "other.splatimate.npz"
    save_clip(dataclasses.replace(clip, source_frames=(0, 77)), path)
    assert evaluate(master_scene, "--out", tmp_path, "--clip", path) == 3
    assert "frame 77" in capsys.readouterr().err
