import subprocess
import sys
from pathlib import Path

import pytest

from animator.cli import main
from exporters import save_clip
from exporters.profiles import PROFILES
from tests.helpers import clips
from tests.helpers.validators import gltf_issues

ROOT = Path(__file__).parents[2]

CHECK_IMPORTS = """
import sys
from animator.cli import main
try:
    code = main(sys.argv[1:])
except SystemExit as end:
    code = end.code
heavy = sorted({{"torch", "cv2", "numba", {also}}} & set(sys.modules))
sys.exit(f"exit {{code}}, imported {{heavy}}" if code or heavy else 0)
"""


def run_and_check_imports(*argv: str, also: str = "") -> str:
    finished = subprocess.run(
        [sys.executable, "-c", CHECK_IMPORTS.format(also=also), *argv],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


@pytest.fixture
def saved_clip(tmp_path) -> str:
    path = tmp_path / "clip.splatimate.npz"
    save_clip(clips.random(), path)
    return str(path)


def test_export_does_not_import_torch(saved_clip, tmp_path):
    run_and_check_imports(
        "export", saved_clip, "--out", str(tmp_path / "x.glb"), "--out", str(tmp_path / "x.usdc")
    )
    assert (tmp_path / "x.glb").exists()
    assert (tmp_path / "x.usdc").exists()


def test_help_imports_no_heavy_package():
    told = run_and_check_imports("animate", "--help", also='"scipy", "pxr", "pygltflib", "rich"')
    assert "--frame-camera" in told
    assert "example:" in told


def test_export_writes_the_caches(saved_clip, tmp_path):
    out = tmp_path / "again.usda"
    assert main(["export", saved_clip, "--out", str(out), "--cache", "both", "-q"]) == 0
    assert out.exists()
    assert (tmp_path / "again_gaussians.usdc").exists()
    assert (tmp_path / "again_gaussians" / "clip_0000.ply").exists()


def test_export_refuses_to_overwrite(saved_clip, tmp_path, capsys):
    (tmp_path / "x.glb").write_text("mine")
    assert main(["export", saved_clip, "--out", str(tmp_path / "x.glb")]) == 5
    assert (tmp_path / "x.glb").read_text() == "mine"
    assert capsys.readouterr().err.startswith("splatimate export: error: ")


@pytest.mark.parametrize("content", [None, b"", b"no clip"])
def test_export_of_something_else_is_bad_input(tmp_path, capsys, content):
    clip = tmp_path / "some.splatimate.npz"
    if content is not None:
        clip.write_bytes(content)
    assert main(["export", str(clip), "--out", str(tmp_path / "x.glb")]) == 3
    assert "some.splatimate.npz" in capsys.readouterr().err
    assert not (tmp_path / "x.glb").exists()


def test_the_profiles_are_listed(capsys):
    assert main(["profiles"]) == 0
    told = capsys.readouterr().out
    assert [line.partition(":")[0] for line in told.splitlines() if line[:1].isalpha()] == [
        *PROFILES,
        *("ran", "read", "rule"),
    ]
    assert "up-axis = Z, meters-per-unit = 0.01, joint-limit = 254" in told


def test_a_profile_reaches_the_file_and_a_flag_wins_over_it(saved_clip, tmp_path):
    out = tmp_path / "x.usda"
    flags = ["--profile", "unreal", "--mesh", "quads"]
    assert main(["export", saved_clip, "--out", str(out), *flags]) == 0
    text = out.read_text()
    assert 'upAxis = "Z"' in text
    assert "metersPerUnit = 0.01" in text
    assert 'def Mesh "Carrier"' in text
    assert 'def Mesh "Surface"' not in text


def test_version(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out.startswith("splatimate ")


def test_the_proxy_alone_passes_the_khronos_validator_without_an_error(tmp_path):
    saved = tmp_path / "clip.splatimate.npz"
    save_clip(clips.hinge(), saved)
    out = tmp_path / "proxy.glb"
    assert main(["export", str(saved), "--out", str(out), "--splats", "none"]) == 0
    assert gltf_issues(out) == []
