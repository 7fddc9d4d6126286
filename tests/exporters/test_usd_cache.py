import dataclasses
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdVol, Vt

from exporters.baking import bake_frames
from exporters.clip import Clip
from exporters.options import ExportOptions
from exporters.usd import samples
from exporters.usd.cache import write_usd_cache
from tests.helpers import clips, validators


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


def test_memory_is_flat_because_each_frame_goes_to_disk(tmp_path):
    clip = clips.random(gaussians=3000, keys=4)
    frame_bytes = 3000 * (12 + 16)
    sizes = []

    def measuring(done: int, total: int) -> None:
        (staged,) = tmp_path.rglob("a.usdc")
        sizes.append(staged.stat().st_size)

    write_usd_cache(clip, tmp_path / "a.usdc", progress=measuring)
    steps = np.diff(sizes)
    assert len(steps) >= 3
    np.testing.assert_allclose(steps, frame_bytes, atol=20_000)  # of python's write buffer


@pytest.mark.parametrize("suffix", ["usda", "usdc"])
def test_frames_are_the_same_if_usd_writes_them_itself(tmp_path, monkeypatch, suffix):
    """Should a later USD lay out its files otherwise, the arrays go the slow way."""
    options = ExportOptions(rotate_sh=True)
    clip = clips.random()
    direct = Usd.Stage.Open(str(write_usd_cache(clip, tmp_path / "a.usdc", options)[0]))
    monkeypatch.setattr(samples, "_find_run", lambda *_: None)
    slow = Usd.Stage.Open(str(write_usd_cache(clip, tmp_path / f"b.{suffix}", options)[0]))
    expected = slow.GetRootLayer().ExportToString()
    assert direct.GetRootLayer().ExportToString() == expected
    assert expected.count("timeSamples") == 4 + 2  # positions and so on; translate, orient


def test_usd_can_go_on_editing_and_saving_the_file(tmp_path):
    clip = clips.random()
    path = tmp_path / "a.usdc"
    stage = Usd.Stage.Open(str(write_usd_cache(clip, path)[0]))
    extra = np.arange(3000, dtype=np.float32).reshape(-1, 3)
    prim = UsdGeom.Points.Define(stage, "/Extra")
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(extra))
    stage.Save()
    del stage, prim
    reopened = Usd.Stage.Open(str(path))
    np.testing.assert_array_equal(
        UsdGeom.Points.Get(reopened, "/Extra").GetPointsAttr().Get(), extra
    )
    for code in range(3):
        found = field_of(reopened).GetPositionsAttr().Get(code)
        np.testing.assert_array_equal(found, clip.pose_at(code / 24).positions)


def test_turned_harmonics_are_sampled(tmp_path):
    clip = clips.random(sh_degree=2)
    (path,) = write_usd_cache(clip, tmp_path / "a.usdc", ExportOptions(rotate_sh=True))
    stage = Usd.Stage.Open(str(path))
    attribute = field_of(stage).GetRadianceSphericalHarmonicsCoefficientsAttr()
    for frame in bake_frames(clip, rotate_sh=True):
        rows = np.array(attribute.Get(frame.code)).reshape(-1, 9, 3)
        np.testing.assert_array_equal(rows, frame.sh_coeffs)
    assert np.abs(rows - clip.splats.sh_coeffs).max() > 0.1


def test_half_precision_keeps_positions_exact(tmp_path):
    clip = clips.random()
    options = ExportOptions(precision="half", rotate_sh=True)
    stage = Usd.Stage.Open(str(write_usd_cache(clip, tmp_path / "a.usdc", options)[0]))
    field = field_of(stage)
    assert not field.GetOrientationsAttr().HasAuthoredValue()
    assert not field.GetRadianceSphericalHarmonicsCoefficientsAttr().HasAuthoredValue()
    posed = clip.pose_at(1 / 24)
    np.testing.assert_array_equal(field.GetPositionsAttr().Get(1), posed.positions)
    found_wxyz = wxyz(field.GetOrientationshAttr().Get(1))
    found_wxyz *= np.sign(np.sum(found_wxyz * posed.quats_wxyz, axis=1))[:, None]
    np.testing.assert_allclose(found_wxyz, posed.quats_wxyz, atol=2**-12)  # 11 bits below 1
    coefficients = field.GetRadianceSphericalHarmonicsCoefficientshAttr()
    assert len(coefficients.GetTimeSamples()) == len(field.GetPositionsAttr().GetTimeSamples())


def test_colors_are_stated_as_displayed_srgb(tmp_path):
    stage = written(clips.static(), tmp_path)
    prim = field_of(stage).GetPrim()
    assert Usd.ColorSpaceAPI.ComputeColorSpaceName(prim, None) == "srgb_rec709_display"
    stated = Usd.ColorSpaceAPI.ComputeColorSpace(prim, None)
    linear = Gf.ColorSpace(Gf.ColorSpaceNames.LinearRec709)
    # IEC 61966-2-1: ((0.5 + 0.055) / 1.055) ** 2.4; 0.02 lies on the straight piece, 0.02 / 12.92.
    converted = linear.Convert(stated, Gf.Vec3f(0.5, 1.0, 0.02)).GetRGB()
    np.testing.assert_allclose(converted, [0.2140411, 1.0, 0.0015480], rtol=2e-3)


@pytest.mark.parametrize("name", sorted(clips.ALL))
def test_usd_validators_find_nothing(name, tmp_path):
    (path,) = write_usd_cache(clips.ALL[name](), tmp_path / "a.usdc")
    assert validators.usd_errors(path) == []


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
