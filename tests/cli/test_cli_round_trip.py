"""What `splatimate export` makes of the saved clip is what the first run wrote, to the byte."""

from pathlib import Path

import pytest

from animator.cli import animate_main, main

ASSETS = ("clip.usda", "other.usd", "other.usdz", "clip.glb", "clip.gltf")


def files_in(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.parametrize(
    "choices",
    [
        (),
        ("--splats", "parts", "--usd-splats", "payload", "--rotate-sh"),
        ("--profile", "blender", "--usd-splats", "sibling", "--tolerance", "0.001"),
    ],
    ids=["default", "splats", "profile"],
)
def test_export_repeats_the_first_run(scene, tmp_path, stub_fit, choices):
    stub_fit.step = 0.01
    first, again = tmp_path / "first", tmp_path / "again"
    flags = ("--cache", "both", "--quiet", *choices)
    outs = [[part for name in ASSETS for part in ("--out", str(f / name))] for f in (first, again)]
    assert animate_main([str(scene / "frames"), *outs[0], *flags]) == 0
    assert main(["export", str(first / "clip.splatimate.npz"), *outs[1], *flags]) == 0
    written = {
        name: content
        for name, content in files_in(first).items()
        if "_report." not in name and not name.endswith(".npz")
    }
    assert files_in(again) == written
    assert {*ASSETS, "clip.bin", "clip_gaussians.usdc"} < set(written)
