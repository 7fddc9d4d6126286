"""Each profile against the rules of its tool, on a clip that breaks them all: 30 frames per second,
inches, Y-up, 300 joints, a camera, view-dependent colors."""

import dataclasses
import functools
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade, UsdSkel

from exporters.clip import Clip
from exporters.keyframes import continue_signs
from exporters.options import ExportOptions
from exporters.profiles import PROFILES
from exporters.registry import export_clip
from tests.helpers import clips, gltf_reader, playback
from tests.helpers.validators import gltf_issues, usd_errors

JOINTS = 300
QUICK_LOOK_TYPES = {
    *("SkelRoot", "Skeleton", "SkelAnimation", "Mesh", "Material", "Shader"),
}


@pytest.fixture(scope="module")
def clip() -> Clip:
    """A ball of Gaussians, each held by four of 300 joints that sway a little about one root."""
    rng = np.random.default_rng(11)
    made = clips.random(gaussians=200, joints=JOINTS, keys=4)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    positions = 10 * directions * rng.uniform(0, 1, (200, 1)) ** (1 / 3)
    still = clips.splats(positions, sh_degree=1)
    splats = dataclasses.replace(still, scales=np.full((200, 3), 1.2), opacities=np.full(200, 0.95))
    rest = rng.normal(0, 5, (JOINTS, 3))
    rest[0] = 0
    turns = np.concatenate([np.ones((4, JOINTS, 1)), rng.normal(0, 0.02, (4, JOINTS, 3))], axis=-1)
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    return dataclasses.replace(
        made,
        name="ball",
        splats=splats,
        rig=dataclasses.replace(
            made.rig,
            parents=[-1, *[0] * (JOINTS - 1)],
            rest_translations=rest,
            rest_quats_wxyz=np.tile(clips.IDENTITY, (JOINTS, 1)),
        ),
        tracks=dataclasses.replace(
            made.tracks,
            times_s=np.arange(4) / 30,
            translations=rest + rng.normal(0, 0.02, (4, JOINTS, 3)),
            quats_wxyz=continue_signs(turns),
        ),
        fps=30.0,
        meters_per_unit=0.0254,
        source_frames=(0, 1, 2, 3),
    )


BEST = {"web": ".glb", "arkit": ".usdz"}
"""The format that a test opens, where it is not .usdc."""


@pytest.fixture(scope="module")
def assets(clip, tmp_path_factory) -> Callable[[str], Path]:
    """Return what writes a profile's asset, in a folder of its own, when it is first asked for."""

    @functools.cache
    def written(profile: str) -> Path:
        folder = tmp_path_factory.mktemp(profile)
        options = dataclasses.replace(PROFILES[profile].options, faces=300)
        return export_clip(clip, folder / f"ball{BEST.get(profile, '.usdc')}", options)[0]

    return written


@pytest.fixture(scope="module")
def package(assets) -> Path:
    return assets("arkit")


def skeleton_of(stage: Usd.Stage) -> UsdSkel.Skeleton:
    (prim,) = [prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Skeleton)]
    return UsdSkel.Skeleton(prim)


def meshes_of(stage: Usd.Stage) -> list[Usd.Prim]:
    return [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]


def world_of(stage: Usd.Stage) -> tuple[str, float, float]:
    return (
        str(UsdGeom.GetStageUpAxis(stage)),
        UsdGeom.GetStageMetersPerUnit(stage),
        stage.GetTimeCodesPerSecond(),
    )


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("suffix", [".usdc", ".glb"])
def test_the_motion_is_the_clips_but_for_what_was_allowed(clip, tmp_path, profile, suffix):
    exact = {"mesh": "quads", "joint_limit": None, "tolerance": 0.0, "usd_splats": "none"}
    options = dataclasses.replace(PROFILES[profile].options, **exact)
    path = export_clip(clip, tmp_path / f"ball{suffix}", options)[0]
    read = playback.usd_centers if suffix == ".usdc" else playback.gltf_centers
    for time_s in (0.0, 0.07, 0.1):
        found, expected = read(path, time_s), playback.clip_centers(clip, time_s)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * 20 * 0.0254)


@pytest.mark.parametrize("profile", sorted(PROFILES.keys() - {"web"}))
def test_every_vertex_has_four_influences_and_every_rig_one_root(assets, profile):
    stage = Usd.Stage.Open(str(assets(profile)))
    joints = list(skeleton_of(stage).GetJointsAttr().Get())
    assert [joint for joint in joints if "/" not in joint] == joints[:1]
    limit = PROFILES[profile].options.joint_limit
    assert len(joints) == (limit or JOINTS)
    for mesh in meshes_of(stage):
        binding = UsdSkel.BindingAPI(mesh)
        for primvar in (binding.GetJointIndicesPrimvar(), binding.GetJointWeightsPrimvar()):
            assert primvar.GetElementSize() == 4


@pytest.mark.parametrize(
    ("profile", "world"),
    [
        ("generic", ("Y", 0.0254, 30)),
        ("blender", ("Z", 1.0, 24)),
        ("unreal", ("Z", 0.01, 30)),
        ("houdini", ("Y", 1.0, 30)),
        ("omniverse", ("Z", 1.0, 30)),
        ("arkit", ("Y", 1.0, 30)),
    ],
)
def test_axes_unit_and_rate_are_the_tools_own(assets, profile, world):
    stage = Usd.Stage.Open(str(assets(profile)))
    assert world_of(stage) == pytest.approx(world)
    # Three intervals of 1/30 s, however they are counted.
    seconds = stage.GetEndTimeCode() / stage.GetTimeCodesPerSecond()
    assert seconds == pytest.approx(0.1)


@pytest.mark.parametrize("profile", ["unreal", "arkit"])
def test_engines_get_one_closed_mesh(assets, profile):
    stage = Usd.Stage.Open(str(assets(profile)))
    (mesh,) = meshes_of(stage)
    assert mesh.GetName() == "Surface"
    corners = np.array(UsdGeom.Mesh(mesh).GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    edges = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


@pytest.mark.parametrize("profile", ["houdini", "omniverse"])
def test_tools_that_draw_splats_can_show_them_or_leave_them_unloaded(assets, profile):
    path = assets(profile)
    assert path.with_name("ball_splats.usdc").is_file()
    for rule, is_loaded in ((Usd.Stage.LoadAll, True), (Usd.Stage.LoadNone, False)):
        stage = Usd.Stage.Open(str(path), rule)
        root = stage.GetDefaultPrim()
        assert [mesh.GetName() for mesh in meshes_of(stage)] == ["Carrier"]
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            root.GetVariantSet("representation").SetVariantSelection("splats")
        assert meshes_of(stage) == []
        positions = root.GetChild("Splats").GetAttribute("positions")
        assert bool(positions.GetNumTimeSamples()) == is_loaded


def test_web_is_small_and_within_scene_viewers_limits(assets):
    path = assets("web")
    assert gltf_issues(path) == []  # not even the false alarms about splats
    file = gltf_reader.read(path)
    assert "cameras" not in file.json
    assert "KHR_gaussian_splatting" not in file.json["extensionsUsed"]
    (skin,) = file.json["skins"]
    assert len(skin["joints"]) == 254
    (mesh,) = file.json["meshes"]
    joints = mesh["primitives"][0]["attributes"]["JOINTS_0"]
    assert file.json["accessors"][joints]["componentType"] == 5121  # unsigned byte
    # A closed surface of genus 0 has F / 2 + 2 vertices.
    assert PROFILES["web"].options.faces / 2 + 2 < 30_000


def test_blender_gets_no_loose_points(clip, tmp_path):
    (path,) = export_clip(clip, tmp_path / "ball.glb", PROFILES["blender"].options)
    file = gltf_reader.read(path)
    assert {p["mode"] for mesh in file.json["meshes"] for p in mesh["primitives"]} == {4}


def test_usd_finds_nothing_wrong_in_a_package_for_quick_look(package):
    assert usd_errors(package) == []
    assert [p.name for p in package.parent.iterdir()] == [package.name]


def test_a_package_is_one_layer_and_a_texture_aligned_and_not_compressed(package):
    with zipfile.ZipFile(package) as archive:
        entries = archive.infolist()
        assert [entry.filename for entry in entries] == ["ball.usdc", "colors.png"]
        assert {entry.compress_type for entry in entries} == {zipfile.ZIP_STORED}
    content = package.read_bytes()
    for entry in entries:
        # The local header: 30 bytes, the name, the extra field, whose lengths are at 26 and 28.
        header = content[entry.header_offset : entry.header_offset + 30]
        lengths = [int.from_bytes(header[at : at + 2], "little") for at in (26, 28)]
        assert (entry.header_offset + 30 + sum(lengths)) % 64 == 0


def test_only_what_quick_look_knows_is_in_it(package):
    stage = Usd.Stage.Open(str(package))
    assert {str(prim.GetTypeName()) for prim in stage.Traverse()} == QUICK_LOOK_TYPES
    assert stage.GetDefaultPrim().IsA(UsdSkel.Root)
    assert len(meshes_of(stage)) == 1
    assert len(skeleton_of(stage).GetJointsAttr().Get()) == 254
    for prim in stage.Traverse():
        if prim.IsA(UsdShade.Shader):
            assert str(UsdShade.Shader(prim).GetIdAttr().Get()).startswith("Usd")


def test_the_texture_shows_the_vertex_colors(package):
    stage = Usd.Stage.Open(str(package))
    mesh = UsdGeom.Mesh(meshes_of(stage)[0])
    material = UsdShade.MaterialBindingAPI(mesh.GetPrim()).ComputeBoundMaterial()[0]
    source = material.ComputeSurfaceSource()[0].GetInput("emissiveColor").GetConnectedSource()
    asset = UsdShade.Shader(source[0].GetPrim()).GetInput("file").Get()
    with zipfile.ZipFile(package) as archive, archive.open(Path(asset.path).name) as stream:
        pixels = np.asarray(Image.open(stream))
    assert pixels.shape == (64, 64, 3)  # 300 triangles: 18 blocks a side, so 32
    uvs = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())
    columns, rows = (uvs * [64, -64] + [0, 64]).astype(int).T
    srgb = pixels[rows, columns] / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    colors = np.array(mesh.GetDisplayColorPrimvar().Get())
    expected = colors[np.array(mesh.GetFaceVertexIndicesAttr().Get())]
    np.testing.assert_allclose(linear, expected, atol=2.3 / 510 + 1e-6)


def test_a_profile_only_makes_choices_that_exist():
    for profile in PROFILES.values():
        assert dataclasses.replace(ExportOptions(), **vars(profile.options)) == profile.options
        assert profile.known in ("ran", "read", "rule")
