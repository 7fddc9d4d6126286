"""An exported glTF file moves as `Clip.pose_at` says, at keys, between them and outside."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from exporters.clip import Clip, Tracks
from exporters.gltf.write import write_gltf
from tests.helpers import clips, gltf_reader, playback

CLIPS = sorted(clips.ALL)


def moments_s(clip: Clip) -> np.ndarray:
    """Keys, three moments between each two, and one past the end."""
    keys = clip.tracks.times_s
    between = [keys[:-1] + share * np.diff(keys) for share in (0.21, 0.5, 0.9)]
    return np.concatenate([keys, *between, [keys[-1] + 1.0]])


def assert_plays_like(path: Path, clip: Clip) -> None:
    for time_s in moments_s(clip):
        truth = playback.clip_centers(clip, time_s)
        diagonal = np.linalg.norm(np.ptp(truth, axis=0))
        error = np.abs(playback.gltf_centers(path, time_s) - truth).max()
        assert error <= 1e-5 * diagonal, f"at {time_s} s"


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", CLIPS)
def test_carrier_follows_the_truth(name: str, suffix: str, tmp_path: Path) -> None:
    clip = clips.ALL[name]()
    path = tmp_path / f"clip{suffix}"
    write_gltf(clip, path)
    assert_plays_like(path, clip)


@settings(
    derandomize=True,
    max_examples=8,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    seed=st.integers(0, 2**32 - 1),
    joints=st.integers(4, 9),
    keys=st.integers(1, 5),
    up_axis=st.sampled_from(["Y", "Z"]),
    meters_per_unit=st.sampled_from([1.0, 0.01, 1000.0]),
)
def test_any_clip_follows_the_truth(
    tmp_path: Path, seed: int, joints: int, keys: int, up_axis: str, meters_per_unit: float
) -> None:
    clip = dataclasses.replace(
        clips.random(gaussians=12, joints=joints, keys=keys, sh_degree=0, seed=seed),
        up_axis=up_axis,
        meters_per_unit=meters_per_unit,
    )
    write_gltf(clip, tmp_path / "clip.glb")
    assert_plays_like(tmp_path / "clip.glb", clip)


def test_door_is_half_open_half_way(tmp_path: Path) -> None:
    write_gltf(clips.hinge(), tmp_path / "door.glb")
    root_half = np.sqrt(0.5)
    np.testing.assert_allclose(
        playback.gltf_centers(tmp_path / "door.glb", 0.5),
        [[0.5, 0.0, 0.0], [1.0 + root_half, root_half, 0.0], [1.0, 0.0, 0.0]],
        atol=1e-6,
    )


def test_z_up_centimeters_become_y_up_meters(tmp_path: Path) -> None:
    write_gltf(clips.z_up_centimeters(), tmp_path / "door.glb")
    opened = playback.gltf_centers(tmp_path / "door.glb", 1.0)
    np.testing.assert_allclose(opened[1], [0.01, 0.0, -0.01], atol=1e-8)


def test_quads_turn_with_their_gaussian(tmp_path: Path) -> None:
    write_gltf(clips.hinge(), tmp_path / "door.glb")
    vertices = gltf_reader.read(tmp_path / "door.glb").skinned_positions("carrier", 1.0)
    quad = vertices.reshape(-1, 4, 3)[1]
    # The long axis (0.03) lay along x and now points along y; the short one (0.02) along -x.
    # Sides of four standard deviations.
    np.testing.assert_allclose(quad[1] - quad[0], [0, 4 * 0.03, 0], atol=1e-6)
    np.testing.assert_allclose(quad[3] - quad[0], [-4 * 0.02, 0, 0], atol=1e-6)


def test_a_single_key_away_from_rest_is_kept(tmp_path: Path) -> None:
    clip = clips.hinge()
    opened = Tracks(
        times_s=[0.0],
        translations=clip.tracks.translations[1:],
        quats_wxyz=clip.tracks.quats_wxyz[1:],
    )
    clip = dataclasses.replace(clip, tracks=opened, source_frames=())
    write_gltf(clip, tmp_path / "door.glb")
    np.testing.assert_allclose(
        playback.gltf_centers(tmp_path / "door.glb", 0.0)[1], [1.0, 1.0, 0.0], atol=1e-6
    )


@pytest.mark.parametrize("name", CLIPS)
def test_gltf_and_usd_agree(name: str, tmp_path: Path) -> None:
    from exporters.usd.write import write_usd_rig

    clip = clips.ALL[name]()
    write_gltf(clip, tmp_path / "clip.glb")
    write_usd_rig(clip, tmp_path / "clip.usdc")
    for time_s in moments_s(clip):
        in_gltf = playback.gltf_centers(tmp_path / "clip.glb", time_s)
        in_usd = playback.usd_centers(tmp_path / "clip.usdc", time_s)
        diagonal = np.linalg.norm(np.ptp(in_gltf, axis=0))
        assert np.abs(in_gltf - in_usd).max() <= 1e-5 * diagonal, f"at {time_s} s"
