"""Moving splats inside a rigged USD asset: sibling and payload."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdVol

from exporters.options import ExportOptions
from exporters.usd.write import write_usd_rig
from tests.helpers import clips, playback, validators

MODES = ("sibling", "payload")
SUFFIXES = ("usda", "usdc", "usdz")


def splats_of(stage: Usd.Stage) -> UsdVol.ParticleField3DGaussianSplat:
    path = stage.GetDefaultPrim().GetPath().AppendChild("Splats")
    return UsdVol.ParticleField3DGaussianSplat(stage.GetPrimAtPath(path))


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("mode", MODES)
def test_the_splats_move_as_the_clip_once_selected(tmp_path, mode, suffix, capfd):
    clip = clips.random()
    options = ExportOptions(usd_splats=mode)
    path, *beside = write_usd_rig(clip, tmp_path / f"clip.{suffix}", options)
    expected = (
        ["clip_splats.usdc"] if (mode, suffix) in ((MODES[1], "usda"), (MODES[1], "usdc")) else []
    )
    assert [file.name for file in beside] == expected
    assert {file.name for file in tmp_path.iterdir()} == {path.name, *expected}
    assert validators.usd_errors(path) == []

    stage = Usd.Stage.Open(str(path))
    playback.usd_skinned_points(stage, 1.0)  # exactly one mesh is there to be skinned
    assert not splats_of(stage).GetPrim().IsActive()
    stage.GetDefaultPrim().GetVariantSet("representation").SetVariantSelection("splats")
    field = splats_of(stage)
    assert [prim.GetName() for prim in stage.Traverse() if prim.IsA(UsdGeom.Gprim)] == ["Splats"]
    for code in field.GetPositionsAttr().GetTimeSamples():
        posed = clip.pose_at(code / 24)
        np.testing.assert_array_equal(field.GetPositionsAttr().Get(code), posed.positions)
        np.testing.assert_allclose(
            field.GetExtentAttr().Get(code), clip.extent_at(code / 24), atol=1e-6
        )
    assert validators.usd_errors(path) == []
    assert "Could not open" not in capfd.readouterr().err


@pytest.mark.parametrize("mode", MODES)
def test_without_a_mesh_the_splats_are_what_is_shown(tmp_path, mode):
    options = ExportOptions(usd_splats=mode, mesh="none")
    path = write_usd_rig(clips.chain(), tmp_path / "clip.usdc", options)[0]
    stage = Usd.Stage.Open(str(path))
    assert splats_of(stage).GetPrim().IsActive()
    assert not stage.GetDefaultPrim().HasVariantSets()
    assert len(splats_of(stage).GetPositionsAttr().GetTimeSamples()) == 4
    assert validators.usd_errors(path) == []


@pytest.mark.parametrize("mode", MODES)
def test_an_asset_can_be_moved_with_its_payload(tmp_path, mode):
    written = write_usd_rig(
        clips.chain(), tmp_path / "a" / "clip.usda", ExportOptions(usd_splats=mode)
    )
    (tmp_path / "b").mkdir()
    moved = [path.rename(tmp_path / "b" / path.name) for path in written]
    stage = Usd.Stage.Open(str(moved[0]))
    stage.GetDefaultPrim().GetVariantSet("representation").SetVariantSelection("splats")
    assert len(splats_of(stage).GetPositionsAttr().GetTimeSamples()) == 4


def test_a_joint_limit_leaves_the_splats_exact(tmp_path):
    clip = clips.random(joints=12)
    options = ExportOptions(usd_splats="sibling", joint_limit=5)
    stage = Usd.Stage.Open(str(write_usd_rig(clip, tmp_path / "clip.usdc", options)[0]))
    found = splats_of(stage).GetPositionsAttr().Get(2)
    np.testing.assert_array_equal(found, clip.pose_at(2 / 24).positions)


@pytest.mark.parametrize("mode", MODES)
def test_the_same_clip_gives_the_same_bytes(tmp_path, mode):
    def contents(folder: Path) -> list[bytes]:
        written = write_usd_rig(
            clips.random(), folder / "clip.usdz", ExportOptions(usd_splats=mode)
        )
        return [path.read_bytes() for path in written]

    assert contents(tmp_path / "a") == contents(tmp_path / "b")
