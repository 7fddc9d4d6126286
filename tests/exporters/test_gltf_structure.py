"""What a glTF file contains, and that the official validator accepts it."""

import dataclasses
import errno
from pathlib import Path

import numpy as np
import pytest

from exporters.clip import Clip, Rig, Tracks
from exporters.errors import ClipError, WriteError
from exporters.gltf.skinned_mesh import joint_index_type
from exporters.gltf.write import write_gltf
from exporters.options import ExportOptions
from tests.helpers import clips, gltf_reader
from tests.helpers.gltf_reader import GltfFile
from tests.helpers.validators import gltf_issues

CLIPS = sorted(clips.ALL)
WITHOUT_SPLATS = ExportOptions(splats="none")


def exported(clip: Clip, folder: Path, options: ExportOptions | None = None) -> GltfFile:
    write_gltf(clip, folder / "clip.glb", options)
    return gltf_reader.read(folder / "clip.glb")


def many_joints(count: int) -> Clip:
    """A chain of `count` joints, each turning a little."""
    clip = clips.static()
    rig = Rig(
        joint_names=tuple(f"joint {i}" for i in range(count)),
        parents=np.arange(count) - 1,
        rest_translations=np.tile([0.01, 0.0, 0.0], (count, 1)),
        rest_quats_wxyz=np.tile(clips.IDENTITY, (count, 1)),
        part_ids=np.zeros(count),
    )
    turned = np.tile([np.cos(0.01), 0.0, 0.0, np.sin(0.01)], (count, 1))
    tracks = Tracks(
        times_s=[0.0, 1.0],
        translations=np.tile(rig.rest_translations, (2, 1, 1)),
        quats_wxyz=[rig.rest_quats_wxyz, turned],
    )
    skin = clips.skin_to([0, 1, count - 1])
    return dataclasses.replace(clip, rig=rig, tracks=tracks, skin=skin, source_frames=())


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", CLIPS)
def test_validator_finds_nothing_in_the_rig(name: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a clip, é{suffix}"
    write_gltf(clips.ALL[name](), path, WITHOUT_SPLATS)
    assert gltf_issues(path) == []


@pytest.mark.parametrize("joint_count", [256, 257])
def test_validator_finds_nothing_in_a_large_rig(joint_count: int, tmp_path: Path) -> None:
    file = exported(many_joints(joint_count), tmp_path, WITHOUT_SPLATS)
    assert gltf_issues(tmp_path / "clip.glb") == []
    primitive = file.json["meshes"][0]["primitives"][0]
    component_type = file.json["accessors"][primitive["attributes"]["JOINTS_0"]]["componentType"]
    assert component_type == {256: 5121, 257: 5123}[joint_count]


@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_validator_stumbles_only_over_the_names_of_splat_attributes(
    sh_degree: int, tmp_path: Path
) -> None:
    """The list is exact, so that this fails when the validator learns the extension."""
    file = exported(clips.random(gaussians=8, sh_degree=sh_degree), tmp_path)
    mesh = next(i for i, m in enumerate(file.json["meshes"]) if m["name"] == "rest_splats")
    names = ["ROTATION", "SCALE", "OPACITY"]
    for degree in range(sh_degree + 1):
        names += [f"SH_DEGREE_{degree}_COEF_{n}" for n in range(2 * degree + 1)]
    pointer = f"/meshes/{mesh}/primitives/0/attributes/KHR_gaussian_splatting:"
    found = {
        (issue.severity, issue.code, issue.pointer) for issue in gltf_issues(tmp_path / "clip.glb")
    }
    assert found == {
        *(("error", "MESH_PRIMITIVE_INVALID_ATTRIBUTE", pointer + name) for name in names),
        ("info", "UNSUPPORTED_EXTENSION", "/extensionsUsed/1"),
    }


def test_extensions_are_never_required(tmp_path: Path) -> None:
    document = exported(clips.random(gaussians=4), tmp_path).json
    assert document["extensionsUsed"] == ["KHR_materials_unlit", "KHR_gaussian_splatting"]
    assert "extensionsRequired" not in document


def test_default_scene_shows_the_rig_and_not_the_splats(tmp_path: Path) -> None:
    file = exported(clips.chain(), tmp_path)
    shown, splats = file.json["scenes"]
    assert file.json["scene"] == 0
    assert {file.json["nodes"][i]["name"] for i in shown["nodes"]} == {"chain", "carrier"}
    assert splats == {"name": "rest_splats", "nodes": [file.node("rest_splats")]}


def test_the_tree_of_nodes_is_the_rig(tmp_path: Path) -> None:
    file = exported(clips.chain(), tmp_path)
    children = {
        node["name"]: [file.json["nodes"][i]["name"] for i in node.get("children", [])]
        for node in file.json["nodes"]
    }
    assert children == {
        "chain": ["root", "camera"],
        "root": ["elbow"],
        "elbow": ["wrist"],
        "wrist": [],
        "camera": [],
        "carrier": [],
        "rest_splats": [],
    }


def test_splats_may_be_left_out(tmp_path: Path) -> None:
    document = exported(clips.chain(), tmp_path, WITHOUT_SPLATS).json
    assert len(document["scenes"]) == len(document["meshes"]) == 1
    assert document["extensionsUsed"] == ["KHR_materials_unlit"]


def test_rest_splats_are_the_clips_splats(tmp_path: Path) -> None:
    clip = clips.random(gaussians=9, sh_degree=2)
    found = exported(clip, tmp_path).attributes("rest_splats")
    prefix = "KHR_gaussian_splatting:"
    splats = clip.splats
    np.testing.assert_array_equal(found["POSITION"], splats.positions)
    np.testing.assert_array_equal(found[prefix + "SCALE"], splats.scales)
    np.testing.assert_array_equal(found[prefix + "OPACITY"][:, 0], splats.opacities)
    w, x, y, z = splats.quats_wxyz.T
    stored = found[prefix + "ROTATION"]
    np.testing.assert_allclose(stored, np.stack([x, y, z, w], axis=1), atol=2e-7)
    for index, name in enumerate(["0_COEF_0", "1_COEF_0", "1_COEF_1", "1_COEF_2", "2_COEF_0"]):
        np.testing.assert_array_equal(
            found[f"{prefix}SH_DEGREE_{name}"], splats.sh_coeffs[:, index]
        )
    np.testing.assert_allclose(found["COLOR_0"][:, 3], splats.opacities, atol=1e-5)


def test_still_properties_have_no_channel(tmp_path: Path) -> None:
    clip = clips.hinge()
    file = exported(clip, tmp_path)
    assert set(file.channels()) == {(file.node("door"), "rotation")}
    assert "animations" not in exported(clips.static(), tmp_path).json


def test_a_rotation_that_only_changes_sign_is_still(tmp_path: Path) -> None:
    clip = clips.hinge()
    flipped = dataclasses.replace(clip.tracks, quats_wxyz=-clip.tracks.quats_wxyz)
    file = exported(dataclasses.replace(clip, tracks=flipped), tmp_path)
    assert set(file.channels()) == {(file.node("door"), "rotation")}


def test_a_tiny_motion_of_a_tiny_object_is_kept(tmp_path: Path) -> None:
    clip = dataclasses.replace(clips.random(gaussians=4), meters_per_unit=1e-6)
    file = exported(clip, tmp_path)
    assert sum(path == "translation" for _, path in file.channels()) == len(clip.rig) + 1


def test_bounds_and_times_are_stored(tmp_path: Path) -> None:
    file = exported(clips.chain(), tmp_path)
    (animation,) = file.json["animations"]
    (times,) = {sampler["input"] for sampler in animation["samplers"]}
    assert file.json["accessors"][times]["min"] == [0.0]
    assert file.json["accessors"][times]["max"] == [0.125]
    np.testing.assert_allclose(file.accessor(times)[:, 0], [0, 1 / 24, 3 / 24], rtol=1e-6)
    for mesh in file.json["meshes"]:
        position = mesh["primitives"][0]["attributes"]["POSITION"]
        values = file.accessor(position)
        assert file.json["accessors"][position]["min"] == values.min(axis=0).tolist()
        assert file.json["accessors"][position]["max"] == values.max(axis=0).tolist()


def test_everything_lies_on_four_bytes(tmp_path: Path) -> None:
    file = exported(clips.random(gaussians=5), tmp_path)
    assert all(view["byteOffset"] % 4 == 0 for view in file.json["bufferViews"])
    assert all(accessor["byteOffset"] % 4 == 0 for accessor in file.json["accessors"])


def test_source_frames_are_kept(tmp_path: Path) -> None:
    (animation,) = exported(clips.chain(), tmp_path).json["animations"]
    assert animation["extras"] == {"fps": 24.0, "source_frames": [10, -1, 12]}


def test_too_many_joints_are_refused() -> None:
    with pytest.raises(ClipError, match="at most 65536, but there are 65537"):
        joint_index_type(65537)


def test_a_glb_of_more_than_four_gibibytes_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("exporters.gltf.write.GLB_BLOB_LIMIT_BYTES", 100)
    with pytest.raises(ClipError, match=r"3 Gaussians .* write a \.gltf"):
        write_gltf(clips.static(), tmp_path / "clip.glb")
    write_gltf(clips.static(), tmp_path / "clip.gltf")
    assert sorted(child.name for child in tmp_path.iterdir()) == ["clip.bin", "clip.gltf"]


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ClipError, match=r"expected a name ending in \.glb or \.gltf, got '\.obj'"):
        write_gltf(clips.static(), tmp_path / "clip.obj")


def test_invalid_clips_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ClipError, match="fps"):
        write_gltf(dataclasses.replace(clips.static(), fps=0.0), tmp_path / "clip.glb")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_two_writes_give_the_same_bytes(suffix: str, tmp_path: Path) -> None:
    contents = []
    for folder in ("first", "second"):
        written = write_gltf(clips.random(), tmp_path / folder / f"clip{suffix}")
        contents.append([(path.name, path.read_bytes()) for path in written])
    assert contents[0] == contents[1]


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_failure_leaves_the_old_file_and_no_other(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / f"clip{suffix}"
    path.write_text("old")
    monkeypatch.setattr("pygltflib.GLTF2.gltf_to_json", fail)
    with pytest.raises(WriteError, match="No space left"):
        write_gltf(clips.static(), path)
    assert [child.name for child in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "old"


def test_gltf_names_its_buffer_as_a_uri(tmp_path: Path) -> None:
    written = write_gltf(clips.static(), tmp_path / "a clip.gltf")
    assert [path.name for path in written] == ["a clip.gltf", "a clip.bin"]
    assert gltf_reader.read(written[0]).json["buffers"][0]["uri"] == "a%20clip.bin"
