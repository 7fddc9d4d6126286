import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import exporters
from exporters.__main__ import main
from exporters.clip_io import save_clip
from exporters.errors import WriteError
from exporters.registry import EXPORTERS, export_clip, exporter_for
from tests.helpers import clips

ROOT = Path(__file__).parents[2]


def test_importing_exporters_loads_nothing_heavy():
    code = (
        "import sys, exporters; "
        "heavy = {'torch', 'animator', 'pxr', 'cv2', 'numba', 'scipy'} & set(sys.modules); "
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


def test_command_line_runs_without_torch(tmp_path):
    save_clip(clips.hinge(), tmp_path / "c.splatimate.npz")
    code = (
        "import sys; sys.modules.update(torch=None, animator=None); "  # importing either now fails
        "from exporters.__main__ import main; sys.exit(main(sys.argv[1:]))"
    )
    outputs = [tmp_path / "c.usda", tmp_path / "c_gaussians", tmp_path / "c_gaussians.usdc"]
    subprocess.run(
        [sys.executable, "-c", code, tmp_path / "c.splatimate.npz", *outputs], check=True, cwd=ROOT
    )
    assert all(path.exists() for path in outputs)


@pytest.mark.parametrize("entry", sorted(set(EXPORTERS.values())))
def test_every_entry_resolves(entry):
    module_name, function_name = entry.split(":")
    assert callable(getattr(importlib.import_module(module_name), function_name))


@pytest.mark.parametrize(
    ("name", "function_name"),
    [
        ("clip.usd", "write_usd_rig"),
        ("clip.USDZ", "write_usd_rig"),
        ("clip.glb", "write_gltf"),
        ("clip_gaussians.usdc", "write_usd_cache"),
        ("clip_gaussians", "write_ply_sequence"),
        ("clip.splatimate.npz", "save_clip"),
    ],
)
def test_longest_ending_counts(name, function_name):
    assert exporter_for(Path("somewhere") / name).__name__ == function_name


@pytest.mark.parametrize("name", ["clip.fbx", "clip", "clip.npz"])
def test_unknown_endings_name_the_known_ones(tmp_path, name):
    with pytest.raises(WriteError, match=r"\.usdz.*\.glb") as caught:
        export_clip(clips.static(), tmp_path / name)
    assert name in str(caught.value)


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(EXPORTERS, ".fbx", "no_such_package.fbx:write")
    with pytest.raises(WriteError, match="needs the package 'no_such_package'"):
        exporter_for("clip.fbx")


def test_export_returns_the_files(tmp_path):
    assert export_clip(clips.static(), tmp_path / "a.usdc") == (tmp_path / "a.usdc",)
    sequence = export_clip(clips.hinge(), tmp_path / "a_gaussians")
    assert sequence[24] == tmp_path / "a_gaussians" / "clip_0024.ply"
    assert all(path.is_file() for path in sequence)


def test_command_line_exit_codes(tmp_path, capsys):
    clip_path = tmp_path / "c.splatimate.npz"
    save_clip(clips.static(), clip_path)
    assert main([str(clip_path), str(tmp_path / "c.usda")]) == 0
    usd_path = tmp_path / "d.usda"
    assert main([str(clip_path), str(usd_path), "--profile", "blender"]) == 0
    assert 'upAxis = "Z"' in usd_path.read_text()
    assert main([str(tmp_path / "missing.npz"), str(tmp_path / "c.usda")]) == 3
    assert main([str(clip_path), str(tmp_path / "c.fbx")]) == 5
    with pytest.raises(SystemExit, match="2"):
        main([str(clip_path)])
    capsys.readouterr()


def test_public_names_exist():
    assert all(hasattr(exporters, name) for name in exporters.__all__)
