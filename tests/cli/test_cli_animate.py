import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from animator.cli import animate_main, main
from exporters import load_clip

EXPECTED_FILES = {
    "clip.usda",
    "clip.glb",
    "clip_gaussians.usdc",
    "clip.splatimate.npz",
    "clip_report.json",
    "clip_report.html",
    "clip_report.png",
    *(f"clip_gaussians/clip_{k:04d}.ply" for k in range(4)),
}


def files_in(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


def digests_in(folder: Path) -> dict[str, str]:
    return {
        name: hashlib.sha256((folder / name).read_bytes()).hexdigest()
        for name in files_in(folder)
        if "_report." not in name  # reports hold wall times
    }


@pytest.fixture
def out(tmp_path) -> Path:
    folder = tmp_path / "out"
    folder.mkdir()
    return folder


def run(scene: Path, out: Path, *flags: str) -> int:
    outs = ["--out", str(out / "clip.usda"), "--out", str(out / "clip.glb")]
    return animate_main([str(scene / "frames"), *outs, *flags])


def test_writes_every_output_and_nothing_else(scene, out, stub_fit):
    assert run(scene, out) == 0
    assert files_in(out) == EXPECTED_FILES


def test_rest_frames_are_explained_almost_perfectly(scene, out, stub_fit):
    run(scene, out)
    report = json.loads((out / "clip_report.json").read_text())
    # The frames are 8-bit renders of the rest pose, so only rounding is left.
    assert report["summary"]["mean_psnr_db"] > 45
    assert report["summary"]["mean_silhouette_iou"] > 0.99
    assert report["summary"]["largest_skin_error_percent"] < 1e-4
    assert [row["number"] for row in report["frames"]] == [0, 1, 2, 3]
    assert [row["matches"] for row in report["frames"]] == [0, 7, 14, 21]


def test_options_reach_the_fit_and_the_clip(scene, out, stub_fit):
    flags = ["--no-deform", "--no-group", "--no-refinement", "--iterations", "7", "--seed", "5"]
    flags += ["--fps", "12", "--every", "2", "--name", "cube", "--up-axis", "Z", "--cache", "none"]
    assert run(scene, out, *flags, "--meters-per-unit", "0.5", "--threads", "1") == 0
    config = stub_fit.configs[0]
    weights = config.driver.image_solver.weights
    assert (config.seed, config.driver.image_solver.pace.most_steps) == (5, 7)
    assert config.loosening.pace.most_steps == 7
    assert (config.driver.use_matches, weights.deform, weights.group) == (False, 0, 0)
    assert config.driver.rigid.use_growing
    assert not config.driver.rigid.use_refinement
    clip = load_clip(out / "clip.splatimate.npz")
    assert (clip.name, clip.up_axis, clip.meters_per_unit) == ("cube", "Z", 0.5)
    assert clip.source_frames == (0, 2)
    np.testing.assert_allclose(clip.tracks.times_s, [0, 1 / 12])
    assert not (out / "clip_gaussians").exists()


def test_existing_outputs_are_refused_before_any_work(scene, out, stub_fit, capsys):
    (out / "clip_report.json").write_text("mine")
    assert run(scene, out) == 5
    assert "--overwrite" in capsys.readouterr().err
    assert stub_fit.configs == []
    assert files_in(out) == {"clip_report.json"}
    assert run(scene, out, "--overwrite") == 0
    assert files_in(out) == EXPECTED_FILES


def test_missing_output_folders_are_made_but_not_for_a_failed_run(scene, out, stub_fit):
    shutil.rmtree(out)
    next((scene / "frames").iterdir()).write_bytes(b"not a picture")
    assert run(scene, out) == 3
    assert not out.exists()


def test_a_file_in_the_way_of_the_output_folder_is_refused(scene, out, stub_fit, capsys):
    shutil.rmtree(out)
    out.write_text("mine")
    assert run(scene, out / "deeper") == 5
    assert str(out) in capsys.readouterr().err
    assert stub_fit.configs == []


def test_overwrite_spares_a_folder_with_other_files(scene, out, stub_fit, capsys):
    (out / "clip_gaussians").mkdir()
    (out / "clip_gaussians" / "holiday.jpg").write_text("mine")
    assert run(scene, out, "--overwrite") == 5
    assert "holiday.jpg" in capsys.readouterr().err
    assert files_in(out) == {"clip_gaussians/holiday.jpg"}


def test_below_the_gate_everything_is_written_and_the_exit_code_is_4(scene, out, stub_fit, capsys):
    stub_fit.step = 0.5
    assert run(scene, out, "--min-iou", "0.9") == 4
    assert "--min-iou" in capsys.readouterr().err
    assert files_in(out) == EXPECTED_FILES
    assert json.loads((out / "clip_report.json").read_text())["summary"]["is_good"] is False


def test_interrupted_run_resumes_to_the_same_bytes(scene, out, tmp_path, stub_fit, capsys):
    stub_fit.step = 0.01
    whole = tmp_path / "whole"
    whole.mkdir()
    assert run(scene, whole) == 0

    stub_fit.interrupt_at = 3
    assert run(scene, out) == 130
    assert "--resume" in capsys.readouterr().err
    assert files_in(out) == {"clip.progress.npz"}

    stub_fit.interrupt_at, stub_fit.solved_indices = None, []
    assert run(scene, out, "--resume") == 0
    assert stub_fit.solved_indices == [3]
    assert digests_in(out) == digests_in(whole)


@pytest.mark.parametrize("change", ["option", "splat", "frame"])
def test_resume_refuses_another_run(scene, out, stub_fit, capsys, change):
    stub_fit.interrupt_at = 2
    run(scene, out)
    stub_fit.interrupt_at = None
    flags = ["--anchors", "50"] if change == "option" else []
    if change == "splat":
        content = bytearray((scene / "init.ply").read_bytes())
        content[-1] ^= 1
        (scene / "init.ply").write_bytes(content)
    if change == "frame":
        shutil.copy(scene / "frames" / "0001.png", scene / "frames" / "0004.png")
    assert run(scene, out, "--resume", *flags) == 3
    assert "clip.progress.npz" in capsys.readouterr().err
    assert run(scene, out, *flags) == 0


def test_files_touched_but_unchanged_do_not_prevent_a_resume(scene, out, stub_fit):
    stub_fit.interrupt_at = 2
    run(scene, out)
    stub_fit.interrupt_at = None
    shutil.copy(scene / "init.ply", scene / "copy")
    shutil.move(scene / "copy", scene / "init.ply")
    assert run(scene, out, "--resume", "--inbetween", "0", "--min-iou", "0.1") == 0


def test_dry_run_tells_the_plan_and_writes_nothing(scene, out, stub_fit, capsys):
    assert run(scene, out, "--dry-run", "--inbetween", "2") == 0
    told = capsys.readouterr().out
    for name in ("clip.usda", "clip.glb", "clip_gaussians.usdc", "clip_report.html"):
        assert str(out / name) in told
    assert "write 10 frames" in told  # 4 solved and 2 in each of 3 gaps
    assert files_in(out) == set()
    assert stub_fit.configs == []


def test_inspect_estimates_the_ply_cache_to_the_byte(scene, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["inspect", str(scene / "frames"), "--cache", "ply"]) == 0
    told = capsys.readouterr().out
    assert "clip_gaussians  ~ 33 kB" in told  # 4 frames * 120 Gaussians * 17 floats * 4 bytes
    assert files_in(tmp_path) == files_in(scene.parent)  # nothing beside the scene itself


def test_inspect_without_a_splat_says_what_is_missing(scene, capsys):
    (scene / "init.ply").unlink()
    assert main(["inspect", str(scene / "frames")]) == 3
    told = capsys.readouterr().out
    assert "--gaussians" in told
    assert "readable: frames" in told


def spoil_camera(scene: Path) -> None:
    (scene / "transforms_frames.json").unlink()


def spoil_folder(scene: Path) -> None:
    for path in (scene / "frames").iterdir():
        path.unlink()


def spoil_ply(scene: Path) -> None:
    content = (scene / "init.ply").read_bytes()
    (scene / "init.ply").write_bytes(content[: len(content) // 2])


def spoil_size(scene: Path) -> None:
    from PIL import Image

    Image.new("RGBA", (32, 64)).save(scene / "frames" / "0002.png")


@pytest.mark.parametrize(
    ("spoil", "hint"),
    [
        (spoil_camera, "--cameras"),
        (spoil_folder, "frames"),
        (spoil_ply, "init.ply"),
        (spoil_size, "0002.png"),
    ],
)
def test_bad_input_exits_with_3_one_message_and_no_file(scene, out, stub_fit, capsys, spoil, hint):
    spoil(scene)
    assert run(scene, out, "--quiet") == 3
    err = capsys.readouterr().err
    assert err.startswith("animate: error: ")
    assert hint in err
    assert "Traceback" not in err
    assert files_in(out) == set()


def test_verbose_shows_the_traceback(scene, out, stub_fit, capsys):
    spoil_ply(scene)
    assert run(scene, out, "--verbose") == 3
    assert "Traceback" in capsys.readouterr().err


def test_unforeseen_errors_exit_with_1_and_no_traceback(scene, out, monkeypatch, capsys):
    def fail(*arguments, **options):
        raise RuntimeError("out of luck")

    monkeypatch.setattr("animator.commands.animate.fit", fail)
    assert run(scene, out) == 1
    err = capsys.readouterr().err
    assert "out of luck" in err
    assert "Traceback" not in err


def test_quiet_says_nothing_and_the_default_a_line_a_frame(scene, out, stub_fit, capsys):
    assert run(scene, out, "--quiet") == 0
    assert capsys.readouterr().err == ""
    assert run(scene, out, "--overwrite") == 0
    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if line.startswith("frame ")] != []
    assert sum(line.startswith("frame ") for line in lines) == 4
    assert any("14 matches at 0.50 px" in line for line in lines)


def test_a_failing_write_says_how_to_go_on(scene, out, stub_fit, monkeypatch, capsys):
    from exporters.errors import WriteError
    from exporters.registry import export_clip

    def full_disk(clip, path, options):
        if path.suffix == ".glb":
            raise WriteError(f"{path}: no space left")
        return export_clip(clip, path, options)

    monkeypatch.setattr("animator.commands.clip_files.export_clip", full_disk)
    assert run(scene, out) == 5
    assert "splatimate export" in capsys.readouterr().err
    assert load_clip(out / "clip.splatimate.npz").source_frames == (0, 1, 2, 3)
    assert (out / "clip.progress.npz").exists()
