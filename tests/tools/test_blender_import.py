"""Blender imports what is written and puts every vertex where the clip has it."""

from pathlib import Path

import numpy as np
import pytest

from exporters.clip import Clip
from exporters.meshes import meshes_of
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.helpers import clips
from tests.helpers.playback import to_y_up_meters
from tests.tools.expected import expected_points, moments, worst_error
from tests.tools.playing import play_in_blender

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
    played = play_in_blender(path, keys_s + halves_s, fps=clip.fps)
    meshes = meshes_of(clip, options)
    assert set(played.meshes) == {mesh.name for mesh in meshes}
    for mesh in meshes:
        tracks = played.meshes[mesh.name]
        at_keys, between = tracks.at(slice(None, len(keys_s))), tracks.at(slice(len(keys_s), None))
        assert worst_error(clip, mesh, at_keys, keys_s) < TOLERANCE
        if halves_s:
            # Blender turns along chords; from the arc that is less than 1e-3 in the lamp.
            assert worst_error(clip, mesh, between, halves_s, "lerp") < TOLERANCE


def test_quads_are_where_pose_at_says(fitted_lamp: Clip) -> None:
    """The construction that tools are compared with is the truth that every clip has."""
    (quads,) = meshes_of(fitted_lamp, ExportOptions())
    time_s = float(fitted_lamp.tracks.times_s[-1]) * 0.7
    centers = expected_points(fitted_lamp, quads, time_s).reshape(-1, 4, 3).mean(axis=1)
    truth = to_y_up_meters(
        fitted_lamp.pose_at(time_s).positions,
        up_axis=fitted_lamp.up_axis,
        meters_per_unit=fitted_lamp.meters_per_unit,
    )
    np.testing.assert_allclose(centers, truth, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "options"),
    [("Carrier", ExportOptions()), ("Surface", ExportOptions(mesh="surface", texture=True))],
)
def test_usd_comes_with_its_colors_and_nothing_to_tidy_up(
    name: str, options: ExportOptions, tmp_path: Path
) -> None:
    path = tmp_path / "hinge.usdc"
    export_clip(clips.hinge(), path, options)
    scene = play_in_blender(path, [0.0], fps=24.0).scene
    assert sorted(scene["objects"].values()) == ["ARMATURE", "CAMERA", "EMPTY", "MESH"]
    assert scene["materials"] == {name: [f"{name}Material"]}
