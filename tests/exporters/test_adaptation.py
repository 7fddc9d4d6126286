import dataclasses
from pathlib import Path

import numpy as np
import pytest
from plyfile import PlyData
from pxr import Usd, UsdGeom

from exporters.adaptation import adapt
from exporters.clip import Clip
from exporters.coordinates import in_world
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.helpers import clips, gltf_reader, playback

ELSEWHERE = ExportOptions(up_axis="Z", meters_per_unit=0.01, fps=30.0, camera=False)
"""A world that no test clip lives in."""


def played(path: Path, time_s: float) -> np.ndarray:
    read = playback.gltf_centers if path.suffix in (".glb", ".gltf") else playback.usd_centers
    return read(path, time_s)


def test_nothing_asked_changes_nothing():
    clip = clips.random()
    assert adapt(clip, ExportOptions()) is clip
    assert adapt(clip, ExportOptions(up_axis="Y", meters_per_unit=1.0, fps=24.0)) is clip


def test_hinge_in_z_up_centimeters_by_hand():
    adapted = adapt(clips.hinge(), ELSEWHERE)
    adapted.validate()
    assert (adapted.up_axis, adapted.meters_per_unit, adapted.fps) == ("Z", 0.01, 30.0)
    assert adapted.camera is None
    # (x, y, z) lies at (x, -z, y): the door opens from +x to +z.
    np.testing.assert_allclose(adapted.splats.positions[1], [200, 0, 0], atol=1e-4)
    np.testing.assert_allclose(adapted.pose_at(1.0).positions[1], [100, 0, 100], atol=1e-4)
    np.testing.assert_allclose(adapted.splats.scales[0], [3, 2, 1], rtol=1e-6)


@pytest.mark.parametrize("make", clips.ALL.values(), ids=clips.ALL.keys())
def test_there_and_back_is_the_same_clip(make):
    clip = make()
    there = in_world(clip, up_axis="Z" if clip.up_axis == "Y" else "Y", meters_per_unit=0.3048)
    back = in_world(there, up_axis=clip.up_axis, meters_per_unit=clip.meters_per_unit)
    for part in ("splats", "rig", "tracks", "skin"):
        for field in dataclasses.fields(getattr(clip, part)):
            before, after = (getattr(getattr(c, part), field.name) for c in (clip, back))
            if isinstance(before, np.ndarray):
                np.testing.assert_allclose(after, before, atol=1e-6, err_msg=field.name)


@pytest.mark.parametrize("suffix", ["usdc", "glb"])
def test_an_adapted_asset_plays_the_same_motion(tmp_path, suffix):
    clip = clips.random()
    (path,) = export_clip(clip, tmp_path / f"clip.{suffix}", ELSEWHERE)
    diagonal = np.linalg.norm(np.ptp(clip.splats.positions, axis=0))
    for time_s in (0.0, 0.1, clip.tracks.times_s[-1]):
        expected = playback.clip_centers(clip, time_s)
        np.testing.assert_allclose(played(path, time_s), expected, atol=1e-6 * diagonal)


def test_usd_names_the_world_it_was_adapted_to(tmp_path):
    for ending in ("clip.usda", "clip_gaussians.usdc"):
        (path,) = export_clip(clips.hinge(), tmp_path / ending, ELSEWHERE)
        stage = Usd.Stage.Open(str(path))
        assert UsdGeom.GetStageUpAxis(stage) == "Z"
        assert UsdGeom.GetStageMetersPerUnit(stage) == 0.01
        assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == 30
        assert stage.GetEndTimeCode() == 30
        assert not [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]


def test_gltf_keeps_its_own_world_and_rate(tmp_path):
    with_camera = dataclasses.replace(ELSEWHERE, camera=True)
    (plain,) = export_clip(clips.random(), tmp_path / "plain.glb", ExportOptions())
    (adapted,) = export_clip(clips.random(), tmp_path / "adapted.glb", with_camera)
    assert adapted.read_bytes() == plain.read_bytes()
    (without,) = export_clip(clips.random(), tmp_path / "without.glb", ELSEWHERE)
    assert "cameras" not in gltf_reader.read(without).json
    assert gltf_reader.read(plain).json["cameras"]


def cached_centers(path: Path, frame: int) -> np.ndarray:
    if path.is_dir():
        vertices = PlyData.read(path / f"clip_{frame:04d}.ply")["vertex"]
        return np.stack([vertices[axis] for axis in "xyz"], axis=1)
    stage = Usd.Stage.Open(str(path))
    (splats,) = [p for p in stage.Traverse() if "Gaussian" in str(p.GetTypeName())]
    return np.array(splats.GetAttribute("positions").Get(frame))


@pytest.mark.parametrize("ending", ["clip_gaussians", "clip_gaussians.usdc"])
def test_caches_hold_a_frame_at_each_moment_of_the_new_rate(tmp_path, ending):
    clip: Clip = clips.hinge()  # one second at 24 frames per second
    export_clip(clip, tmp_path / ending, ExportOptions(fps=30.0, up_axis="Z"))
    for frame in (0, 7, 30):
        expected = clip.pose_at(frame / 30).positions @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
        np.testing.assert_allclose(cached_centers(tmp_path / ending, frame), expected, atol=1e-6)
    if (tmp_path / ending).is_dir():
        assert len(list((tmp_path / ending).iterdir())) == 31
