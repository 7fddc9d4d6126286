import dataclasses
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Kind, Usd, UsdGeom, UsdSkel

from exporters.carrier import HALF_SIZE_SIGMAS
from exporters.clip import Clip, Rig, Tracks
from exporters.errors import ClipError, WriteError
from exporters.usd.cache import write_usd_cache
from exporters.usd.write import write_usd_rig
from tests.helpers import clips
from tests.helpers.validators import usd_errors

SUFFIXES = ("usd", "usda", "usdc", "usdz")
WRITERS = {"rig": write_usd_rig, "cache": write_usd_cache}


def written(clip: Clip, folder: Path, suffix: str = "usdc") -> Usd.Stage:
    return Usd.Stage.Open(str(write_usd_rig(clip, folder / f"clip.{suffix}")[0]))


def prim(stage: Usd.Stage, name: str) -> Usd.Prim:
    return stage.GetPrimAtPath(stage.GetDefaultPrim().GetPath().AppendPath(name))


def skinned_points(stage: Usd.Stage, code: float) -> np.ndarray:
    """The carrier's points at a time code, by UsdSkel itself, shape (N, 4, 3)."""
    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    (target,) = binding.GetSkinningTargets()
    skeleton_query = cache.GetSkelQuery(binding.GetSkeleton())
    transforms = skeleton_query.ComputeSkinningTransforms(code)
    points = UsdGeom.Mesh(target.GetPrim()).GetPointsAttr().Get()
    assert target.ComputeSkinnedPoints(transforms, points, code)
    return np.array(points).reshape(-1, 4, 3)


def diagonal(clip: Clip) -> float:
    return float(np.linalg.norm(np.ptp(clip.splats.positions, axis=0)))


@pytest.mark.parametrize("make", clips.ALL.values(), ids=clips.ALL.keys())
def test_usd_skins_the_carrier_as_the_clip_poses(make, tmp_path):
    clip = make()
    stage = written(clip, tmp_path)
    last = clip.tracks.times_s[-1] * clip.fps
    keys = clip.tracks.times_s * clip.fps
    between = (keys[:-1] + keys[1:]) / 2
    for code in [*keys, *between, last / 3]:
        centers = skinned_points(stage, code).mean(axis=1)
        expected = clip.pose_at(code / clip.fps).positions
        np.testing.assert_allclose(centers, expected, atol=1e-5 * diagonal(clip))


@pytest.mark.parametrize("code", [0.0, 7.0, 24.0])
def test_quads_turn_with_their_gaussians(tmp_path, code):
    clip = clips.hinge()
    corners = skinned_points(written(clip, tmp_path), code)
    posed = clip.pose_at(code / 24)
    for i in (0, 1):  # Gaussian 2 blends two rotations: there the skin shears
        quat = Gf.Quatd(*map(float, posed.quats_wxyz[i]))
        for axis, expected_side in (
            (0, corners[i, 1] - corners[i, 0]),
            (1, corners[i, 3] - corners[i, 0]),
        ):
            unit = Gf.Vec3d(*np.eye(3)[axis])
            length = 2 * HALF_SIZE_SIGMAS * clip.splats.scales[i, axis]
            side = np.array(Gf.Rotation(quat).TransformDir(unit)) * length
            np.testing.assert_allclose(side, expected_side, atol=1e-6)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("writer", WRITERS.values(), ids=WRITERS.keys())
def test_usd_validation_finds_nothing(tmp_path, suffix, writer):
    clip = dataclasses.replace(clips.random(), name="a näme: with spaces")
    assert usd_errors(writer(clip, tmp_path / f"clip.{suffix}")[0]) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("writer", WRITERS.values(), ids=WRITERS.keys())
def test_same_clip_same_bytes(tmp_path, suffix, writer):
    first, second = (tmp_path / folder / f"clip.{suffix}" for folder in "ab")
    writer(clips.random(), first)
    writer(clips.random(), second)
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("writer", WRITERS.values(), ids=WRITERS.keys())
def test_stage_metadata(tmp_path, writer):
    clip = dataclasses.replace(clips.z_up_centimeters(), fps=30.0)
    stage = Usd.Stage.Open(str(writer(clip, tmp_path / "clip.usdc")[0]))
    root = stage.GetDefaultPrim()
    assert (root.GetName(), root.GetDisplayName()) == ("hinge_z_cm", "hinge z cm")
    assert Usd.ModelAPI(root).GetKind() == Kind.Tokens.component
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.01
    assert stage.GetFramesPerSecond() == stage.GetTimeCodesPerSecond() == 30
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 30)
    assert list(root.GetCustomDataByKey("splatimate:sourceFrames")) == [0, 24]


def test_layout(tmp_path):
    stage = written(clips.hinge(), tmp_path)
    found = {str(p.GetPath()): p.GetTypeName() for p in stage.Traverse()}
    assert found == {
        "/hinge": "SkelRoot",
        "/hinge/Skel": "Skeleton",
        "/hinge/Skel/Anim": "SkelAnimation",
        "/hinge/Carrier": "Mesh",
        "/hinge/Camera": "Camera",
        "/hinge/CarrierMaterial": "Material",
        "/hinge/CarrierMaterial/Surface": "Shader",
        "/hinge/CarrierMaterial/Color": "Shader",
        "/hinge/CarrierMaterial/Black": "Shader",
    }


def test_skeleton_has_one_root_unique_leaves_and_both_rest_and_bind(tmp_path):
    clip = clips.random()
    stage = written(clip, tmp_path)
    skeleton = UsdSkel.Skeleton(prim(stage, "Skel"))
    joints = list(skeleton.GetJointsAttr().Get())
    leaves = [joint.rsplit("/", 1)[-1] for joint in joints]
    assert [joint for joint in joints if "/" not in joint] == ["root"]
    assert len(set(leaves)) == len(clip.rig)
    assert list(skeleton.GetJointNamesAttr().Get()) == list(clip.rig.joint_names)
    bind = np.array(skeleton.GetBindTransformsAttr().Get()).swapaxes(1, 2)
    rest = np.array(skeleton.GetRestTransformsAttr().Get()).swapaxes(1, 2)
    np.testing.assert_allclose(bind, clip.bind_matrices(), atol=1e-12)
    for joint, parent in enumerate(clip.rig.parents):
        world = bind[parent] @ rest[joint] if parent >= 0 else rest[joint]
        np.testing.assert_allclose(world, bind[joint], atol=1e-12)


def test_animation_has_scales_time_codes_and_wxyz(tmp_path):
    clip = clips.chain()
    stage = written(clip, tmp_path)
    animation = UsdSkel.Animation(prim(stage, "Skel/Anim"))
    assert np.array(animation.GetScalesAttr().Get()).tolist() == [[1, 1, 1]] * 3
    assert animation.GetRotationsAttr().GetTimeSamples() == [0, 1, 3]
    assert animation.GetTranslationsAttr().GetTimeSamples() == [0, 1, 3]
    turn = animation.GetRotationsAttr().Get(1)[2]
    assert turn.GetReal() == pytest.approx(np.cos(np.pi / 8))
    assert np.array(turn.GetImaginary()) == pytest.approx([0, 0, np.sin(np.pi / 8)])


def test_usd_interpolates_rotations_on_the_arc(tmp_path):
    stage = written(clips.hinge(), tmp_path)
    query = UsdSkel.Cache().GetAnimQuery(UsdSkel.Animation(prim(stage, "Skel/Anim")))
    matrices = query.ComputeJointLocalTransforms(8.0)  # a third of 90 degrees
    x_axis = matrices[1].TransformDir(Gf.Vec3d(1, 0, 0))
    np.testing.assert_allclose(x_axis, [np.cos(np.pi / 6), 0.5, 0], atol=1e-6)


def test_influences_are_four_normalized_and_never_twice_one_joint(tmp_path):
    clip = clips.random()
    sloppy = np.array(clip.skin.weights) * 1.00005  # within the tolerance of validate()
    clip = dataclasses.replace(clip, skin=dataclasses.replace(clip.skin, weights=sloppy))
    stage = written(clip, tmp_path)
    binding = UsdSkel.BindingAPI(prim(stage, "Carrier"))
    for primvar in (binding.GetJointIndicesPrimvar(), binding.GetJointWeightsPrimvar()):
        assert (primvar.GetElementSize(), primvar.GetInterpolation()) == (4, "vertex")
    # Blender knows no other method, so ours must not depend on one.
    assert binding.GetSkinningMethodAttr().Get() == "classicLinear"
    weights = np.array(binding.GetJointWeightsPrimvar().Get()).reshape(-1, 4)
    joint_ids = np.array(binding.GetJointIndicesPrimvar().Get()).reshape(-1, 4)
    assert len(weights) == 4 * len(clip.splats)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1.5e-7)
    for row_ids, row_weights in zip(joint_ids, weights, strict=True):
        used = row_ids[row_weights > 0]
        assert len(set(used)) == len(used)
        assert (row_ids[row_weights == 0] == 0).all()


def test_carrier_mesh_is_ready_to_be_drawn(tmp_path):
    clip = clips.hinge()
    stage = written(clip, tmp_path)
    mesh = UsdGeom.Mesh(prim(stage, "Carrier"))
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    assert mesh.GetDoubleSidedAttr().Get() is True
    assert list(mesh.GetFaceVertexCountsAttr().Get()) == [4, 4, 4]
    points = np.array(mesh.GetPointsAttr().Get())
    expected = np.stack([points.min(axis=0), points.max(axis=0)])
    np.testing.assert_array_equal(mesh.GetExtentAttr().Get(), expected)
    colors, opacities = mesh.GetDisplayColorPrimvar(), mesh.GetDisplayOpacityPrimvar()
    assert colors.GetInterpolation() == opacities.GetInterpolation() == "vertex"
    srgb = 0.5 + clips.SH_C0 * clip.splats.sh_coeffs[1, 0]
    linear = [
        ((value + 0.055) / 1.055) ** 2.4 if value > 0.04045 else value / 12.92 for value in srgb
    ]
    np.testing.assert_allclose(np.array(colors.Get())[4:8], np.tile(linear, (4, 1)), atol=1e-6)
    np.testing.assert_allclose(np.array(opacities.Get())[4:8], clip.splats.opacities[1])


@pytest.mark.parametrize("make", clips.ALL.values(), ids=clips.ALL.keys())
def test_root_extent_holds_every_skinned_point_and_ellipsoid(make, tmp_path):
    clip = make()
    stage = written(clip, tmp_path)
    low, high = np.array(UsdSkel.Root(stage.GetDefaultPrim()).GetExtentAttr().Get())
    for time_s in clip.tracks.times_s:
        points = skinned_points(stage, time_s * clip.fps).reshape(-1, 3)
        box = np.concatenate([points, clip.extent_at(time_s)])
        assert (box.min(axis=0) >= low - 1e-5).all()
        assert (box.max(axis=0) <= high + 1e-5).all()


@pytest.mark.parametrize("joints", [254, 300])
def test_many_joints(tmp_path, caplog, joints):
    clip = clips.random(joints=joints, gaussians=joints, keys=2)
    centers = skinned_points(written(clip, tmp_path), 1.0).mean(axis=1)
    expected = clip.pose_at(1 / 24).positions
    np.testing.assert_allclose(centers, expected, atol=1e-5 * np.ptp(expected))
    assert ("300 joints" in caplog.text) == (joints == 300)


def test_deep_chain(tmp_path):
    joints = 60
    rig = Rig(
        joint_names=tuple(f"link {i}" for i in range(joints)),
        parents=np.arange(joints) - 1,
        rest_translations=np.tile([0.1, 0, 0], (joints, 1)),
        rest_quats_wxyz=np.tile(clips.IDENTITY, (joints, 1)),
        part_ids=np.full(joints, -1),
    )
    bent = np.tile([np.cos(0.05), 0, 0, np.sin(0.05)], (joints, 1))
    tracks = Tracks(
        times_s=[0.0, 0.25],
        translations=np.tile(rig.rest_translations, (2, 1, 1)),
        quats_wxyz=[rig.rest_quats_wxyz, bent],
    )
    clip = dataclasses.replace(
        clips.static(),
        rig=rig,
        tracks=tracks,
        skin=clips.skin_to([0, 30, 59]),
        source_frames=(),
    )
    stage = written(clip, tmp_path)
    for code in (3.0, 6.0):
        centers = skinned_points(stage, code).mean(axis=1)
        np.testing.assert_allclose(centers, clip.pose_at(code / 24).positions, atol=1e-5 * 6)


@pytest.mark.parametrize("writer", WRITERS.values(), ids=WRITERS.keys())
@pytest.mark.parametrize("suffix", ["usda", "usdz"])
def test_failure_half_way_leaves_nothing(tmp_path, monkeypatch, writer, suffix):
    def fail(*_: object) -> None:
        raise KeyboardInterrupt

    module = writer.__module__
    monkeypatch.setattr(f"{module}.define_camera", fail)
    with pytest.raises(KeyboardInterrupt):
        writer(clips.hinge(), tmp_path / f"clip.{suffix}")
    assert not list(tmp_path.iterdir())


def test_refusals(tmp_path):
    with pytest.raises(ClipError, match="fps"):
        write_usd_rig(dataclasses.replace(clips.static(), fps=0.0), tmp_path / "clip.usda")
    with pytest.raises(WriteError, match=r"\.usdz"):
        write_usd_rig(clips.static(), tmp_path / "clip.abc")
    assert not list(tmp_path.iterdir())
