import dataclasses
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdVol

from exporters.clip import Clip
from exporters.usd.cache import write_usd_cache
from tests.helpers import clips


def written(clip: Clip, folder: Path, suffix: str = "usdc") -> Usd.Stage:
    return Usd.Stage.Open(str(write_usd_cache(clip, folder / f"clip_gaussians.{suffix}")[0]))


def field_of(stage: Usd.Stage) -> UsdVol.ParticleField3DGaussianSplat:
    path = stage.GetDefaultPrim().GetPath().AppendChild("Splats")
    return UsdVol.ParticleField3DGaussianSplat(stage.GetPrimAtPath(path))


def wxyz(array) -> np.ndarray:
    return np.array([[q.GetReal(), *q.GetImaginary()] for q in array])


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usdz"])
def test_every_frame_is_the_clip_posed(tmp_path, suffix):
    clip = clips.random()
    stage = written(clip, tmp_path, suffix)
    field = field_of(stage)
    codes = field.GetPositionsAttr().GetTimeSamples()
    assert codes == list(range(round(clip.tracks.times_s[-1] * 24) + 1))
    assert field.GetOrientationsAttr().GetTimeSamples() == codes
    assert field.GetExtentAttr().GetTimeSamples() == codes
    for code in codes:
        posed = clip.pose_at(code / 24)
        np.testing.assert_array_equal(field.GetPositionsAttr().Get(code), posed.positions)
        found_wxyz = wxyz(field.GetOrientationsAttr().Get(code))
        cosines = np.sum(found_wxyz * posed.quats_wxyz, axis=1)
        np.testing.assert_allclose(np.abs(cosines), 1, atol=1e-6)
        extent = clip.extent_at(code / 24)
        np.testing.assert_allclose(field.GetExtentAttr().Get(code), extent, atol=1e-6)


def test_usd_interpolates_the_samples_lerp_and_slerp(tmp_path):
    clip = clips.hinge()
    stage = written(clip, tmp_path)
    field = field_of(stage)
    positions, orientations = field.GetPositionsAttr(), field.GetOrientationsAttr()
    middle = (np.array(positions.Get(3)) + np.array(positions.Get(4))) / 2
    np.testing.assert_allclose(positions.Get(3.5), middle, atol=1e-6)
    expected = clip.pose_at(3.5 / 24).quats_wxyz  # slerp of a constant turn is exact between frames
    np.testing.assert_allclose(wxyz(orientations.Get(3.5)), expected, atol=1e-6)


def test_static_attributes_once_activated_and_complete(tmp_path):
    clip = clips.random(sh_degree=2)
    stage = written(clip, tmp_path)
    field = field_of(stage)
    scales, opacities = field.GetScalesAttr(), field.GetOpacitiesAttr()
    harmonics = field.GetRadianceSphericalHarmonicsCoefficientsAttr()
    for attribute in (scales, opacities, harmonics):
        assert attribute.GetTimeSamples() == []
    np.testing.assert_array_equal(scales.Get(), clip.splats.scales)
    np.testing.assert_array_equal(opacities.Get(), clip.splats.opacities)
    assert field.GetRadianceSphericalHarmonicsDegreeAttr().Get() == 2
    assert field.GetSortingModeHintAttr().Get() == "zDepth"
    np.testing.assert_array_equal(
        np.array(harmonics.Get()).reshape(-1, 9, 3), clip.splats.sh_coeffs
    )


def test_orientations_do_not_jump_in_sign(tmp_path):
    clip = clips.hinge()
    half_angles = np.radians([0, 60, 120, 179])
    zeros = np.zeros(4)
    door = np.stack([np.cos(half_angles), zeros, zeros, np.sin(half_angles)], axis=-1)
    tracks = dataclasses.replace(
        clip.tracks,
        times_s=[0, 1 / 3, 2 / 3, 1],
        translations=np.tile(clip.rig.rest_translations, (4, 1, 1)),
        quats_wxyz=np.stack([np.tile(clips.IDENTITY, (4, 1)), door], axis=1),
    )
    clip = dataclasses.replace(clip, tracks=tracks, source_frames=())
    stage = written(clip, tmp_path)
    orientations = field_of(stage).GetOrientationsAttr()
    rows = np.array([wxyz(orientations.Get(code)) for code in range(25)])
    rows = rows[:, :2]  # Gaussian 2, half and half, truly flips as the two turns become opposite
    assert np.einsum("tni,tni->tn", rows[1:], rows[:-1]).min() > 0.9
    assert rows[24, 1, 0] < -0.99  # all the way round, to the other sign of nearly the identity


def test_memory_is_flat_because_each_frame_is_saved(tmp_path, monkeypatch):
    saved = []
    save = Usd.Stage.Save

    def counting(stage):
        saved.append(stage)
        save(stage)

    monkeypatch.setattr(Usd.Stage, "Save", counting)
    write_usd_cache(clips.hinge(), tmp_path / "a.usdc")
    assert len(saved) == 25 + 1
    saved.clear()
    write_usd_cache(clips.hinge(), tmp_path / "a.usda")
    assert len(saved) == 1


def test_extent_hint_holds_the_whole_motion(tmp_path):
    clip = clips.hinge()
    stage = written(clip, tmp_path)
    field = field_of(stage)
    hint = UsdGeom.ModelAPI(field.GetPrim().GetParent()).GetExtentsHint()
    extents = np.array([clip.extent_at(code / 24) for code in range(25)])
    np.testing.assert_allclose(
        hint, [extents[:, 0].min(axis=0), extents[:, 1].max(axis=0)], atol=1e-6
    )


def test_an_interrupt_leaves_nothing(tmp_path):
    def interrupted(done: int, total: int) -> None:
        assert total == 25
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_usd_cache(clips.hinge(), tmp_path / "a.usdc", progress=interrupted)
    assert not list(tmp_path.iterdir())
