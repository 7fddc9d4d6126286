"""three.js loads what is written and puts every vertex where the clip has it, between keys too."""

from pathlib import Path

import pytest

from exporters.clip import Clip
from exporters.meshes import meshes_of
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.helpers import clips
from tests.tools.expected import moments, worst_error
from tests.tools.playing import play_in_three

pytestmark = pytest.mark.tools

TOLERANCE = 1e-4
"""Of the diagonal."""


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz", ".glb"])
@pytest.mark.parametrize("name", sorted(clips.ALL))
def test_quads_move_as_the_clip_does(name: str, suffix: str, tmp_path: Path) -> None:
    check(clips.ALL[name](), tmp_path / f"clip{suffix}", ExportOptions())


@pytest.mark.parametrize("suffix", [".usdc", ".glb"])
@pytest.mark.parametrize("mesh", ["quads", "surface", "both"])
def test_a_fitted_clip_moves_as_it_was_fitted(
    mesh: str, suffix: str, fitted_lamp: Clip, tmp_path: Path
) -> None:
    check(fitted_lamp, tmp_path / f"lamp{suffix}", ExportOptions(mesh=mesh, faces=4000))


def check(clip: Clip, path: Path, options: ExportOptions) -> None:
    export_clip(clip, path, options)
    keys_s, halves_s = moments(clip)
    played = play_in_three(path, keys_s + halves_s)
    meshes = meshes_of(clip, options)
    assert set(played.meshes) == {mesh.name for mesh in meshes}
    for mesh in meshes:
        error = worst_error(clip, mesh, played.meshes[mesh.name], keys_s + halves_s)
        assert error < TOLERANCE


def test_colors_of_the_vertices_survive_in_gltf(tmp_path: Path) -> None:
    path = tmp_path / "hinge.glb"
    export_clip(clips.hinge(), path)
    shown = play_in_three(path, [0.0]).scene["meshes"]
    assert len(shown) == 2, "the carrier, and the splats at rest as points"
    assert all(mesh["has_colors"] for mesh in shown)
