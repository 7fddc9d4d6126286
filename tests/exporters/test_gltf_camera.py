"""The glTF camera sees what the solved camera saw."""

import dataclasses
import logging
from pathlib import Path

import numpy as np
import pytest

from exporters.clip import Clip
from exporters.gltf.write import write_gltf
from tests.helpers import clips, gltf_reader


def centered(clip: Clip) -> Clip:
    """The same clip with the principal point in the middle, which glTF can express."""
    camera = clip.camera
    assert camera is not None
    intrinsics = camera.intrinsics.copy()
    intrinsics[:2, 2] = camera.width_px / 2, camera.height_px / 2
    return dataclasses.replace(clip, camera=dataclasses.replace(camera, intrinsics=intrinsics))


def project_gltf(path: Path, time_s: float, points: np.ndarray, size_px: tuple) -> np.ndarray:
    """Project Y-up meters through the file's camera (glTF 2.0, section 3.10.3), in pixels."""
    file = gltf_reader.read(path)
    (camera,) = file.json["cameras"]
    world_from_camera = file.world_matrices(time_s)[file.node("camera")]
    in_camera = (points - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    lens = camera["perspective"]
    up = np.tan(lens["yfov"] / 2)
    ndc = in_camera[:, :2] / -in_camera[:, 2:] / [lens["aspectRatio"] * up, up]
    return (ndc * [1, -1] + 1) / 2 * size_px


@pytest.mark.parametrize("key", [0, 1, 2])
def test_points_land_on_the_same_pixels(key: int, tmp_path: Path) -> None:
    clip = centered(clips.chain())
    camera = clip.camera
    assert camera is not None
    write_gltf(clip, tmp_path / "clip.glb")
    points = np.array([[0.3, 0.2, 0.1], [-0.4, 0.6, 0.2], [0.0, -0.5, 0.7]])
    in_camera = points @ camera.cam_from_world[key, :3, :3].T + camera.cam_from_world[key, :3, 3]
    expected_px = in_camera @ camera.intrinsics.T
    expected_px = expected_px[:, :2] / expected_px[:, 2:]
    size_px = (camera.width_px, camera.height_px)
    time_s = clip.tracks.times_s[key]
    found_px = project_gltf(tmp_path / "clip.glb", time_s, points, size_px)
    np.testing.assert_allclose(found_px, expected_px, atol=1e-3)


def test_static_camera_has_no_channel(tmp_path: Path) -> None:
    write_gltf(clips.hinge(), tmp_path / "clip.glb")
    file = gltf_reader.read(tmp_path / "clip.glb")
    assert file.node("camera") not in {node for node, _ in file.channels()}


def test_moving_camera_shares_the_clock_of_the_joints(tmp_path: Path) -> None:
    write_gltf(clips.chain(), tmp_path / "clip.glb")
    (animation,) = gltf_reader.read(tmp_path / "clip.glb").json["animations"]
    assert len({sampler["input"] for sampler in animation["samplers"]}) == 1
    file = gltf_reader.read(tmp_path / "clip.glb")
    assert file.node("camera") in {node for node, _ in file.channels()}


def test_lost_principal_point_is_said_once_and_kept_in_extras(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        write_gltf(clips.chain(), tmp_path / "clip.glb")
    # 301.5 - 640 / 2 and 260.25 - 480 / 2.
    (message,) = [record.getMessage() for record in caplog.records]
    assert "(-18.5, 20.2) px" in message
    (camera,) = gltf_reader.read(tmp_path / "clip.glb").json["cameras"]
    assert camera["extras"]["intrinsics_px"][0] == [700.0, 0.0, 301.5]


def test_centered_camera_says_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        write_gltf(centered(clips.chain()), tmp_path / "clip.glb")
    assert not caplog.records
