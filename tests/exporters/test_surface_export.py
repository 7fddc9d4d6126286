"""The surface in both formats: it lies where it should, moves with the joints, and is valid."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSkel

from exporters.clip import Clip
from exporters.gltf.write import write_gltf
from exporters.meshes import meshes_of
from exporters.options import ExportOptions
from exporters.skinned_mesh import SkinnedMesh
from exporters.usd.write import write_usd_rig
from tests.helpers import clips, gltf_reader, solids, validators

MESHES = {
    "quads": ["carrier"],
    "surface": ["surface"],
    "both": ["surface", "carrier"],
    "none": [],
}


def options_for(mesh: str) -> ExportOptions:
    return ExportOptions(mesh=mesh, faces=200, splats="none")


@pytest.fixture(scope="module")
def clip() -> Clip:
    """A ball whose right half turns by 90 degrees about +z, the middle by a mean of both."""
    ball = solids.ball(count=60)
    share = np.clip(ball.positions[:, 0] + 0.5, 0, 1)
    skin = clips.skin_to([0] * len(ball))
    weights, joint_ids = skin.weights.copy(), skin.joint_ids.copy()
    weights[:, 0], weights[:, 1], joint_ids[:, 1] = 1 - share, share, 1
    joint_ids[share == 0, 1] = 0
    skin = dataclasses.replace(skin, joint_ids=joint_ids, weights=weights)
    return dataclasses.replace(solids.clip_of(ball, skin, joints=2), camera=clips.camera())


@pytest.fixture(scope="module")
def surface(clip: Clip) -> SkinnedMesh:
    (mesh,) = meshes_of(clip, options_for("surface"))
    return mesh


@pytest.fixture(scope="module")
def folder(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`<mesh>.glb` and `<mesh>.usdc` for every choice."""
    folder = tmp_path_factory.mktemp("meshes")
    for mesh in MESHES:
        write_gltf(clip, folder / f"{mesh}.glb", options_for(mesh))
        write_usd_rig(clip, folder / f"{mesh}.usdc", options_for(mesh))
    return folder


def skinned(mesh: SkinnedMesh, clip: Clip, time_s: float) -> np.ndarray:
    """Linear blend skinning, vertex by vertex."""
    matrices = clip.joint_matrices_at(time_s) @ np.linalg.inv(clip.bind_matrices())
    moved = []
    for point, joints, weights in zip(mesh.positions, mesh.joint_ids, mesh.weights, strict=True):
        blend = sum(weight * matrices[joint] for joint, weight in zip(joints, weights, strict=True))
        moved.append((blend @ [*point, 1.0])[:3])
    return np.array(moved)


@pytest.mark.parametrize("time_s", [0.0, 0.4, 1.0])
def test_gltf_plays_the_surface(
    clip: Clip, surface: SkinnedMesh, folder: Path, time_s: float
) -> None:
    found = gltf_reader.read(folder / "surface.glb").skinned_positions("surface", time_s)
    np.testing.assert_allclose(found, skinned(surface, clip, time_s), atol=1e-5)


@pytest.mark.parametrize("time_s", [0.0, 0.4, 1.0])
def test_usd_plays_the_surface(
    clip: Clip, surface: SkinnedMesh, folder: Path, time_s: float
) -> None:
    stage = Usd.Stage.Open(str(folder / "both.usdc"))
    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    targets = {target.GetPrim().GetName(): target for target in binding.GetSkinningTargets()}
    assert list(targets) == ["Surface", "Carrier"]
    transforms = cache.GetSkelQuery(binding.GetSkeleton()).ComputeSkinningTransforms(time_s * 24)
    mesh = UsdGeom.Mesh(targets["Surface"].GetPrim())
    points = mesh.GetPointsAttr().Get()
    assert targets["Surface"].ComputeSkinnedPoints(transforms, points, time_s * 24)
    np.testing.assert_allclose(points, skinned(surface, clip, time_s), atol=1e-5)
    low, high = np.array(root.GetExtentAttr().Get())
    assert (np.array(points) >= low - 1e-6).all()
    assert (np.array(points) <= high + 1e-6).all()


def test_the_surface_moves_with_the_gaussians(clip: Clip, surface: SkinnedMesh) -> None:
    """Each vertex stays near the Gaussian it was nearest to, on the same side of the skin."""
    at_rest = np.linalg.norm(surface.positions[:, None] - clip.splats.positions, axis=2)
    nearest = at_rest.argmin(axis=1)
    posed = clip.pose_at(1.0).positions[nearest]
    distances = np.linalg.norm(skinned(surface, clip, 1.0) - posed, axis=1)
    assert distances.max() < at_rest.min(axis=1).max() + 0.15


@pytest.mark.parametrize("mesh", MESHES)
def test_validators_find_nothing(folder: Path, mesh: str) -> None:
    issues = validators.gltf_issues(folder / f"{mesh}.glb")
    # Without a mesh nothing uses the skin; it stays, since it marks the joints.
    unused = {("info", "UNUSED_OBJECT", "/skins/0")} if mesh == "none" else set()
    assert {(issue.severity, issue.code, issue.pointer) for issue in issues} == unused
    assert validators.usd_errors(folder / f"{mesh}.usdc") == []


@pytest.mark.parametrize("mesh", MESHES)
def test_the_meshes_asked_for_are_written(folder: Path, mesh: str) -> None:
    document = gltf_reader.read(folder / f"{mesh}.glb").json
    assert [found["name"] for found in document.get("meshes", [])] == MESHES[mesh]
    assert {node["name"] for node in document["nodes"] if "skin" in node} == set(MESHES[mesh])
    assert len(document["skins"]) == 1
    stage = Usd.Stage.Open(str(folder / f"{mesh}.usdc"))
    found = [prim.GetName() for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert [name.lower() for name in found] == MESHES[mesh]
    assert stage.GetPrimAtPath("/solid/Skel/Anim")


def test_a_closed_surface_is_opaque_and_smooth(folder: Path) -> None:
    document = gltf_reader.read(folder / "both.glb").json
    materials = {
        mesh["name"]: document["materials"][mesh["primitives"][0]["material"]]
        for mesh in document["meshes"]
    }
    assert materials["carrier"]["alphaMode"] == "MASK"
    assert materials["surface"].get("alphaMode", "OPAQUE") == "OPAQUE"
    assert not materials["surface"].get("doubleSided", False)
    stage = Usd.Stage.Open(str(folder / "surface.usdc"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/solid/Surface"))
    assert mesh.GetNormalsInterpolation() == "vertex"
    assert len(mesh.GetNormalsAttr().Get()) == len(mesh.GetPointsAttr().Get())
    assert mesh.GetDoubleSidedAttr().Get() is False
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}


def test_the_same_bytes_twice(clip: Clip, folder: Path, tmp_path: Path) -> None:
    for write, name in ((write_gltf, "surface.glb"), (write_usd_rig, "surface.usdc")):
        write(clip, tmp_path / name, options_for("surface"))
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()
