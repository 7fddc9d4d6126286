"""Splats as rigid pieces in glTF: what a viewer that follows the specification would draw."""

import dataclasses
import logging
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exporters.clip import Clip
from exporters.gltf.write import write_gltf
from exporters.options import ExportOptions
from exporters.rigid_parts import fit_parts
from tests.helpers import clips, validators
from tests.helpers.gltf_reader import GltfFile, read

PREFIX = "KHR_gaussian_splatting:"


def exported(clip: Clip, folder: Path, **choices) -> GltfFile:
    return read(write_gltf(clip, folder / "clip.glb", ExportOptions(splats="parts", **choices))[0])


def drawn(file: GltfFile, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """The centers and orientations of all splats as the nodes place them, piece after piece."""
    worlds = file.world_matrices(time_s)
    centers, quats_wxyz = [], []
    for child in file.json["nodes"][file.node("splat_parts")]["children"]:
        attributes = file.attributes(file.json["nodes"][child]["name"])
        turn, shift = worlds[child][:3, :3], worlds[child][:3, 3]
        centers.append(attributes["POSITION"] @ turn.T + shift)
        local = Rotation.from_quat(attributes[PREFIX + "ROTATION"])
        quats_wxyz.append((Rotation.from_matrix(turn) * local).as_quat(scalar_first=True))
    return np.concatenate(centers), np.concatenate(quats_wxyz)


@pytest.mark.parametrize("code", [0, 1, 2, 3])
def test_a_rigid_clip_is_exact_at_every_frame(tmp_path, code):
    clip = clips.chain()  # no key at frame 2
    centers, quats_wxyz = drawn(exported(clip, tmp_path), code / 24)
    posed = clip.pose_at(code / 24)
    np.testing.assert_allclose(centers, posed.positions, atol=1e-6)
    cosines = np.abs(np.sum(quats_wxyz * posed.quats_wxyz, axis=1))
    np.testing.assert_allclose(cosines, 1.0, atol=1e-6)


def test_what_a_viewer_draws_is_off_by_what_is_reported(tmp_path):
    clip = clips.random(gaussians=60)
    parts = fit_parts(clip)
    file = exported(clip, tmp_path)
    order = np.concatenate(parts.members)
    diagonal = np.linalg.norm(np.ptp(clip.splats.positions, axis=0))
    shares, angles = [], []
    for time_s in parts.times_s:
        centers, quats_wxyz = drawn(file, time_s)
        posed = clip.pose_at(time_s)
        shares.append(np.linalg.norm(centers - posed.positions[order], axis=1) / diagonal)
        cosines = np.abs(np.sum(quats_wxyz * posed.quats_wxyz[order], axis=1))
        angles.append(2 * np.degrees(np.arccos(np.minimum(cosines, 1))))
    percent = 100 * np.array(shares)
    error = parts.error
    found = [percent.mean(), np.quantile(percent, 0.95), percent.max()]
    np.testing.assert_allclose(
        found, [error.mean_percent, error.p95_percent, error.max_percent], rtol=1e-4
    )
    found = [np.mean(angles), np.quantile(angles, 0.95), np.max(angles)]
    np.testing.assert_allclose(
        found, [error.mean_degrees, error.p95_degrees, error.max_degrees], rtol=1e-3
    )


def test_pieces_lie_in_a_scene_of_their_own_unless_there_is_no_mesh(tmp_path):
    file = exported(clips.chain(), tmp_path)
    shown, pieces = file.json["scenes"]
    root = file.node("splat_parts")
    assert file.json["scene"] == 0
    assert root not in shown["nodes"]
    assert pieces == {"name": "splat_parts", "nodes": [root]}
    names = [file.json["nodes"][i]["name"] for i in file.json["nodes"][root]["children"]]
    assert names == ["part_0", "part_1", "part_2"]
    assert len(file.json["animations"]) == 1

    (only,) = exported(clips.chain(), tmp_path, mesh="none").json["scenes"]
    assert root - 1 in only["nodes"]  # the carrier's node is gone


def test_all_other_attributes_are_those_at_rest(tmp_path):
    clip = clips.random(sh_degree=1)
    file = exported(clip, tmp_path)
    for name, members in zip(fit_parts(clip).names, fit_parts(clip).members, strict=True):
        found = file.attributes(name)
        np.testing.assert_array_equal(found[PREFIX + "SCALE"], clip.splats.scales[members])
        np.testing.assert_array_equal(
            found[PREFIX + "OPACITY"][:, 0], clip.splats.opacities[members]
        )
        np.testing.assert_array_equal(
            found[PREFIX + "SH_DEGREE_1_COEF_2"], clip.splats.sh_coeffs[members, 3]
        )


@pytest.mark.parametrize(
    ("name", "mesh"), [("random", "quads"), ("static", "quads"), ("chain", "none")]
)
def test_the_validator_finds_only_what_it_does_not_know(name, mesh, tmp_path):
    file = exported(clips.ALL[name](), tmp_path, mesh=mesh)
    known = {("info", "UNSUPPORTED_EXTENSION", "/extensionsUsed/1")}
    for index, described in enumerate(file.json["meshes"]):
        for attribute in described["primitives"][0]["attributes"]:
            if attribute.startswith(PREFIX):
                pointer = f"/meshes/{index}/primitives/0/attributes/{attribute}"
                known.add(("error", "MESH_PRIMITIVE_INVALID_ATTRIBUTE", pointer))
    found = {(i.severity, i.code, i.pointer) for i in validators.gltf_issues(tmp_path / "clip.glb")}
    if mesh == "none":
        known.add(("info", "UNUSED_OBJECT", "/skins/0"))  # it tells importers what a joint is
    assert found == known


def test_the_log_says_once_how_far_the_pieces_are_off(tmp_path, caplog):
    with caplog.at_level(logging.INFO, logger="exporters.gltf.parts"):
        exported(clips.random(), tmp_path)
    (record,) = [r for r in caplog.records if r.name == "exporters.gltf.parts"]
    assert "% of the diagonal" in record.getMessage()
    assert "95th percentile" in record.getMessage()


def test_pieces_keep_their_own_key_times(tmp_path):
    clip = clips.hinge()  # two keys a second apart, 25 frames
    channels = exported(clip, tmp_path).channels()
    counts = {len(times) for times, _ in channels.values()}
    assert counts == {2, 25}


def test_one_gaussian_is_enough_for_a_piece():
    clip = clips.hinge()
    one = dataclasses.replace(clip, splats=clip.splats.subset(slice(1, 2)), skin=clips.skin_to([1]))
    parts = fit_parts(one)
    assert parts.error.max_percent < 1e-4
    assert parts.error.max_degrees < 0.1  # its own orientation says how it turned
