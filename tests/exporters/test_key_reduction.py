"""What fewer keys may change, and that they change no more."""

import dataclasses
import itertools
import logging
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pxr import Usd, UsdSkel

from exporters import keyframes, quaternions
from exporters.clip import Clip, Tracks
from exporters.errors import WriteError
from exporters.gltf.write import write_gltf
from exporters.key_reduction import find_kept_keys, measured_shift, with_keys
from exporters.key_spans import NORMALIZED_LERP_ARC, Spans, span_errors
from exporters.options import ExportOptions
from exporters.usd.write import write_usd_rig
from tests.helpers import clips, gltf_reader, playback

ROUNDING = 2e-6  # float32, in diagonals
DEGREES_ROUNDING = 1e-4

dense = settings(
    derandomize=True,
    max_examples=8,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def smooth_clip(
    *, seed: int, joints: int = 6, keys: int = 16, turns_rad: float = 0.8, speed: float = 1.5
) -> Clip:
    """A random tree whose joints swing at different speeds; the root stands still."""
    clip = clips.random(gaussians=20, joints=joints, keys=2, sh_degree=0, seed=seed)
    rng = np.random.default_rng(seed)
    times_s = np.concatenate([[0], np.cumsum(rng.integers(1, 4, keys - 1))]) / 24
    phases = rng.uniform(0, 2 * np.pi, (joints, 3))
    swings = np.sin(rng.uniform(0.3, speed, (joints, 1)) * times_s[:, None, None] + phases)
    turns = np.concatenate([np.ones((keys, joints, 1)), turns_rad * swings[..., ::-1]], axis=2)
    turns[:, 0] = [1, 0, 0, 0]
    shifts = 0.2 * swings
    shifts[:, 0] = 0.3
    quats_wxyz = quaternions.multiply(quaternions.normalize(turns), clip.rig.rest_quats_wxyz)
    tracks = Tracks(
        times_s=times_s,
        translations=clip.rig.rest_translations + shifts,
        quats_wxyz=keyframes.continue_signs(quats_wxyz),
    )
    return dataclasses.replace(clip, tracks=tracks, camera=None, source_frames=())


def one_joint_clip(angles: list[float], places: list[float]) -> Clip:
    """The hinge at equal steps: the door turned by these angles [rad] and shifted along x."""
    clip = clips.hinge()
    quats_wxyz = np.zeros((len(angles), 2, 4))
    quats_wxyz[:, 0, 0] = 1
    quats_wxyz[:, 1, 0] = np.cos(np.array(angles) / 2)
    quats_wxyz[:, 1, 3] = np.sin(np.array(angles) / 2)
    translations = np.tile(clip.rig.rest_translations, (len(angles), 1, 1))
    translations[:, 1, 0] += places
    tracks = Tracks(
        times_s=np.arange(len(angles)) / 24, translations=translations, quats_wxyz=quats_wxyz
    )
    return dataclasses.replace(clip, tracks=tracks, camera=None, source_frames=())


def diagonal(clip: Clip) -> float:
    return float(np.linalg.norm(np.ptp(clip.splats.positions, axis=0)))


def moments_s(clip: Clip) -> list[float]:
    times_s = clip.tracks.times_s
    between = [times_s[:-1] + share * np.diff(times_s) for share in (0.0, 0.2, 0.5, 0.8)]
    return [*np.concatenate(between), times_s[-1]]


def shift(clip: Clip, reduced: Clip, time_s: float) -> float:
    apart = clip.pose_at(time_s).positions - reduced.pose_at(time_s).positions
    return float(np.linalg.norm(apart, axis=1).max()) / diagonal(clip)


def turn_degrees(left: np.ndarray, right: np.ndarray) -> float:
    """Largest angle between rotation matrices (J, 3, 3), by the chord of their columns."""
    halves = np.linalg.norm(left - right, axis=(1, 2)) / np.sqrt(8)
    return float(np.degrees(2 * np.arcsin(np.minimum(halves, 1))).max())


@dense
@given(
    seed=st.integers(0, 2**32 - 1),
    keys=st.integers(1, 24),
    turns_rad=st.sampled_from([0.0, 0.3, 1.5]),
    tolerance=st.floats(1e-4, 0.3),
    tolerance_degrees=st.floats(0.0, 60.0),
)
def test_shared_keys_stay_within_both_tolerances(
    seed: int, keys: int, turns_rad: float, tolerance: float, tolerance_degrees: float
) -> None:
    clip = smooth_clip(seed=seed, keys=keys, turns_rad=turns_rad)
    options = ExportOptions(tolerance=tolerance, tolerance_degrees=tolerance_degrees)
    kept = find_kept_keys(clip, options, shared=True)
    assert (kept == kept[:, :1]).all()
    reduced = dataclasses.replace(clip, tracks=with_keys(clip.tracks, kept[:, 0]))
    reduced.validate()  # times increase, signs are continuous
    for time_s in moments_s(clip):
        assert shift(clip, reduced, time_s) <= tolerance + ROUNDING
        turned = turn_degrees(
            clip.joint_matrices_at(time_s)[:, :3, :3], reduced.joint_matrices_at(time_s)[:, :3, :3]
        )
        assert turned <= tolerance_degrees + DEGREES_ROUNDING


@dense
@given(
    seed=st.integers(0, 2**32 - 1),
    keys=st.integers(2, 40),
    tolerance=st.floats(1e-3, 0.3),
    tolerance_degrees=st.floats(0.1, 60.0),
)
def test_gltf_stays_within_both_tolerances(
    tmp_path: Path, seed: int, keys: int, tolerance: float, tolerance_degrees: float
) -> None:
    clip = smooth_clip(seed=seed, joints=4, keys=keys)
    options = ExportOptions(tolerance=tolerance, tolerance_degrees=tolerance_degrees)
    write_gltf(clip, tmp_path / "clip.glb", options)
    document = gltf_reader.read(tmp_path / "clip.glb")
    joints = document.json["skins"][0]["joints"]
    for time_s in moments_s(clip)[::3]:
        apart = playback.gltf_centers(tmp_path / "clip.glb", time_s) - playback.clip_centers(
            clip, time_s
        )
        assert np.linalg.norm(apart, axis=1).max() <= (tolerance + ROUNDING) * diagonal(clip)
        rotations = np.array(document.world_matrices(time_s))[joints, :3, :3]
        turned = turn_degrees(rotations, clip.joint_matrices_at(time_s)[:, :3, :3])
        assert turned <= tolerance_degrees + 1e-2  # float32 quaternions


@dense
@given(seed=st.integers(0, 2**32 - 1), tolerance=st.floats(1e-3, 0.3))
def test_usd_stays_within_the_tolerance(tmp_path: Path, seed: int, tolerance: float) -> None:
    clip = smooth_clip(seed=seed, keys=10)
    options = ExportOptions(tolerance=tolerance, tolerance_degrees=180.0)
    write_usd_rig(clip, tmp_path / "clip.usdc", options)
    for time_s in moments_s(clip)[::3]:
        apart = playback.usd_centers(tmp_path / "clip.usdc", time_s) - playback.clip_centers(
            clip, time_s
        )
        assert np.linalg.norm(apart, axis=1).max() <= (tolerance + ROUNDING) * diagonal(clip)


@dense
@given(seed=st.integers(0, 2**32 - 1), tolerance=st.floats(1e-2, 0.3))
def test_normalized_linear_interpolation_stays_within_the_tolerance(
    seed: int, tolerance: float
) -> None:
    """Blender interpolates the four numbers of a quaternion and normalizes them."""
    clip = smooth_clip(seed=seed, turns_rad=1.5)
    options = ExportOptions(tolerance=tolerance, tolerance_degrees=180.0)
    kept = np.flatnonzero(find_kept_keys(clip, options, shared=True)[:, 0])
    tracks = with_keys(clip.tracks, np.isin(np.arange(len(clip.tracks)), kept))
    quats_wxyz = np.array(clip.tracks.quats_wxyz)
    for index, (start, end) in enumerate(itertools.pairwise(kept)):
        times_s = clip.tracks.times_s[start : end + 1]
        shares = (times_s - times_s[0]) / (times_s[-1] - times_s[0])
        ends = tracks.quats_wxyz[index : index + 2]
        chord = (1 - shares)[:, None, None] * ends[0] + shares[:, None, None] * ends[1]
        quats_wxyz[start : end + 1] = chord / np.linalg.norm(chord, axis=-1, keepdims=True)
    played = Tracks(
        times_s=clip.tracks.times_s,
        translations=np.stack(
            [keyframes.interpolate(tracks, time_s)[0] for time_s in clip.tracks.times_s]
        ),
        quats_wxyz=keyframes.continue_signs(quats_wxyz),
    )
    reduced = dataclasses.replace(clip, tracks=played)
    for time_s in clip.tracks.times_s:
        assert shift(clip, reduced, time_s) <= tolerance + ROUNDING


@dense
@given(seed=st.integers(0, 2**32 - 1), spread=st.floats(0.2, 3.0))
def test_errors_between_keys_are_bounded(seed: int, spread: float) -> None:
    """Wild turns, where the largest error is between two keys, not at one."""
    rng = np.random.default_rng(seed)
    quats_wxyz = quaternions.normalize(rng.normal([1, 0, 0, 0], spread, (5, 8, 4)))
    tracks = Tracks(
        times_s=np.cumsum(rng.uniform(0.1, 1, 5)),
        translations=rng.normal(size=(5, 8, 3)),
        quats_wxyz=keyframes.continue_signs(quats_wxyz),
    )
    kept = rng.random((5, 8)) < 0.4
    kept[[0, -1]] = True
    spans = Spans.between(kept)
    every = Spans.between(np.ones_like(kept))
    _, within = span_errors(tracks, spans)
    for share in np.linspace(0, 1, 21):
        shifted, turned = spans.interpolate(tracks, share)
        expected_shifted, expected_turned = every.interpolate(tracks, share)
        lengths = np.linalg.norm(shifted - expected_shifted, axis=-1)
        chords = np.minimum(
            np.linalg.norm(turned - expected_turned, axis=-1),
            np.linalg.norm(turned + expected_turned, axis=-1),
        )
        assert (lengths <= within.lengths + 1e-9).all()
        assert (chords <= within.chords + 1e-9).all()


def test_turns_may_be_farther_apart_between_keys_than_at_them() -> None:
    """A steady turn along the equator, against one at a height of 0.1 over two of its keys.

    The great circle between the upper two, pi / 4 apart, rises half-way to the height h with
    sin(h) = sin(0.1) / sqrt(sin(0.1)^2 + cos(0.1)^2 cos(pi / 8)^2): h = 0.10818, chord 0.10813.
    """
    arcs = np.array([0, 1, 4, 5]) * np.pi / 12
    heights = np.array([0, 0.1, 0.1, 0])
    around = [np.cos(arcs) * np.cos(heights), np.sin(arcs) * np.cos(heights)]
    quats_wxyz = np.stack([*around, np.sin(heights), np.zeros(4)], axis=1)[:, None]
    tracks = Tracks(
        times_s=[0.0, 1.0, 4.0, 5.0], translations=np.zeros((4, 1, 3)), quats_wxyz=quats_wxyz
    )
    at_keys, within = span_errors(
        tracks, Spans.between(np.array([[True], [False], [False], [True]]))
    )
    normalized_lerp = NORMALIZED_LERP_ARC * arcs[-1] ** 3
    assert at_keys.chords[1, 0] - normalized_lerp == pytest.approx(2 * np.sin(0.05))
    assert 0.10813 < within.chords[1, 0] - normalized_lerp < 0.11


@pytest.mark.parametrize("tolerance", [0.03, 0.05, 0.08])
@pytest.mark.parametrize("turn", [False, True], ids=["shift", "turn"])
@pytest.mark.parametrize("joints", [[0], [2], [0, 1], [0, 1, 2]], ids=str)
def test_errors_down_a_chain_add_up(joints: list[int], turn: bool, tolerance: float) -> None:
    """All joints jolt at the middle key, the same way; the last Gaussian gets it all."""
    clip = clips.chain()
    angles, places = np.zeros((3, 3)), np.zeros((3, 3))
    (angles if turn else places)[1, joints] = 0.07
    quats_wxyz = np.zeros((3, 3, 4))
    quats_wxyz[..., 0], quats_wxyz[..., 3] = np.cos(angles / 2), np.sin(angles / 2)
    translations = np.tile(clip.rig.rest_translations, (3, 1, 1))
    translations[..., 1] += places
    tracks = Tracks(times_s=clip.tracks.times_s, translations=translations, quats_wxyz=quats_wxyz)
    clip = dataclasses.replace(clip, tracks=tracks)
    options = ExportOptions(tolerance=tolerance, tolerance_degrees=90.0)
    kept = find_kept_keys(clip, options, shared=True)[:, 0]
    # The diagonal is 2; the last Gaussian lies 2.5, 1.5 and 0.5 from the joints.
    levers = np.array([2.5, 1.5, 0.5]) if turn else np.ones(3)
    largest = 0.07 * levers[joints].sum() / 2
    assert kept[1] == (largest > tolerance)
    reduced = dataclasses.replace(clip, tracks=with_keys(tracks, kept))
    assert shift(clip, reduced, tracks.times_s[1]) <= tolerance + ROUNDING


@pytest.mark.parametrize(
    ("angles", "places", "expected"),
    [
        (np.linspace(0, 1, 9), np.zeros(9), [0, 8]),
        (np.zeros(9), np.linspace(0, 1, 9), [0, 8]),
        (np.zeros(9), np.abs(np.arange(9) - 5), [0, 5, 8]),
        (np.concatenate([np.zeros(4), np.full(5, 0.5)]), np.zeros(9), [0, 3, 4, 8]),
    ],
    ids=["steady turn", "steady shift", "kink", "jump"],
)
def test_only_keys_that_say_something_are_kept(
    angles: np.ndarray, places: np.ndarray, expected: list[int]
) -> None:
    clip = one_joint_clip(list(angles), list(places))
    # Steady turns lose what normalized interpolation would: 0.0184 * 0.5^3 of 4 in length.
    kept = find_kept_keys(clip, ExportOptions(tolerance=0.005), shared=False)
    assert np.flatnonzero(kept[:, 1]).tolist() == expected
    assert np.flatnonzero(kept[:, 0]).tolist() == [0, 8]


def test_a_full_turn_keeps_its_way_round(tmp_path: Path) -> None:
    clip = one_joint_clip(list(np.linspace(0, 2 * np.pi, 17)), [0.0] * 17)
    options = ExportOptions(tolerance=0.05, tolerance_degrees=30.0)
    kept = find_kept_keys(clip, options, shared=False)[:, 1]
    assert 4 <= kept.sum() < 17
    write_gltf(clip, tmp_path / "clip.glb", options)
    half_way = playback.gltf_centers(tmp_path / "clip.glb", 8 / 24)
    np.testing.assert_allclose(half_way[1], [0, 0, 0], atol=0.05 * diagonal(clip))


@pytest.mark.parametrize("shared", [False, True])
def test_smooth_motion_loses_keys_and_no_tolerance_none(shared: bool) -> None:
    clip = smooth_clip(seed=3, keys=40)
    loose = ExportOptions(tolerance=0.02, tolerance_degrees=10.0)
    kept = find_kept_keys(clip, loose, shared=shared)
    assert kept.mean() < 0.7
    assert kept[[0, -1]].all()
    assert find_kept_keys(clip, ExportOptions(), shared=shared).all()


def test_no_tolerance_changes_no_byte(tmp_path: Path) -> None:
    clip = smooth_clip(seed=5)
    for writer, suffix in ((write_gltf, "glb"), (write_usd_rig, "usdc")):
        names = [tmp_path / folder / f"clip.{suffix}" for folder in "ab"]
        writer(clip, names[0])
        writer(clip, names[1], ExportOptions(tolerance=0.0, tolerance_degrees=90.0))
        assert names[0].read_bytes() == names[1].read_bytes()


def test_same_clip_same_bytes_with_a_tolerance(tmp_path: Path) -> None:
    options = ExportOptions(tolerance=0.01, tolerance_degrees=5.0)
    for writer, suffix in ((write_gltf, "glb"), (write_usd_rig, "usdc")):
        names = [tmp_path / folder / f"clip.{suffix}" for folder in "ab"]
        for name in names:
            writer(smooth_clip(seed=5, keys=30), name, options)
        assert names[0].read_bytes() == names[1].read_bytes()


def test_equal_key_times_are_one_accessor_and_constants_two_keys(tmp_path: Path) -> None:
    clip = smooth_clip(seed=3, joints=8, keys=60)
    write_gltf(clip, tmp_path / "all.glb")
    options = ExportOptions(tolerance=0.02, tolerance_degrees=10.0)
    write_gltf(clip, tmp_path / "some.glb", options)
    reduced = gltf_reader.read(tmp_path / "some.glb")
    (animation,) = reduced.json["animations"]
    inputs = {sampler["input"] for sampler in animation["samplers"]}
    contents = {reduced.accessor(index).tobytes() for index in inputs}
    assert 1 < len(inputs) == len(contents)
    last_s = np.float32(clip.tracks.times_s[-1])
    for times_s, _ in reduced.channels().values():
        assert (times_s[0], times_s[-1]) == (0, last_s)
        assert (np.diff(times_s) > 0).all()
    times_s, values = reduced.channels()[reduced.node("root"), "translation"]
    assert len(times_s) == len(values) == 2
    assert (tmp_path / "some.glb").stat().st_size < (tmp_path / "all.glb").stat().st_size


def test_own_times_are_written_only_where_they_save_room(tmp_path: Path) -> None:
    """A time accessor costs more than a few short channels save."""
    clip = one_joint_clip([0.0] * 4, [0.0, 0.1, 0.2, 0.3])
    options = ExportOptions(tolerance=0.01)
    assert find_kept_keys(clip, options, shared=False)[:, 1].tolist() == [True, False, False, True]
    write_gltf(clip, tmp_path / "clip.glb", options)
    document = gltf_reader.read(tmp_path / "clip.glb")
    (times_s, _), *_ = document.channels().values()
    assert len(times_s) == 4


def test_usd_leaves_out_whole_samples(tmp_path: Path) -> None:
    clip = smooth_clip(seed=3, keys=40)
    options = ExportOptions(tolerance=0.02, tolerance_degrees=10.0)
    write_usd_rig(clip, tmp_path / "clip.usdc", options)
    stage = Usd.Stage.Open(str(tmp_path / "clip.usdc"))
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/random/Skel/Anim"))
    codes = animation.GetRotationsAttr().GetTimeSamples()
    assert codes == animation.GetTranslationsAttr().GetTimeSamples()
    kept = find_kept_keys(clip, options, shared=True)[:, 0]
    np.testing.assert_array_equal(codes, keyframes.key_codes(clip)[kept])
    assert 2 < len(codes) < 40


def test_log_tells_the_measured_shift(caplog: pytest.LogCaptureFixture) -> None:
    clip = smooth_clip(seed=3, keys=40)
    options = ExportOptions(tolerance=0.02, tolerance_degrees=10.0)
    with caplog.at_level(logging.INFO, logger="exporters"):
        kept = find_kept_keys(clip, options, shared=True)
    measured = measured_shift(clip, kept) / diagonal(clip)
    assert f"{measured:.2g} of the diagonal" in caplog.text
    reduced = dataclasses.replace(clip, tracks=with_keys(clip.tracks, kept[:, 0]))
    expected = max(shift(clip, reduced, time_s) for time_s in moments_s(clip)[: 40 - 1])
    assert measured >= expected - ROUNDING
    assert measured <= 0.02


@pytest.mark.parametrize("field", ["tolerance", "tolerance_degrees"])
@pytest.mark.parametrize("value", [-0.1, float("nan")])
def test_a_tolerance_that_is_none_is_refused(field: str, value: float) -> None:
    options = dataclasses.replace(ExportOptions(tolerance=0.1), **{field: value})
    with pytest.raises(WriteError, match=f"{field}: expected a number, 0 or more"):
        find_kept_keys(clips.hinge(), options, shared=True)


def test_a_single_gaussian_keeps_its_keys() -> None:
    """There is no diagonal to measure by."""
    clip = clips.random(gaussians=1, keys=6)
    assert find_kept_keys(clip, ExportOptions(tolerance=0.1), shared=False).all()


def test_signs_stay_continuous_where_keys_are_gone(tmp_path: Path) -> None:
    """Unit quaternions of a full turn end at the opposite of the first one."""
    clip = one_joint_clip(list(np.linspace(0, 2 * np.pi, 65)), [0.0] * 65)
    options = ExportOptions(tolerance=10.0, tolerance_degrees=360.0)
    kept = find_kept_keys(clip, options, shared=True)[:, 0]
    assert kept.sum() == 2
    turns = with_keys(clip.tracks, kept).quats_wxyz[:, 1]
    np.testing.assert_allclose(turns, [[1, 0, 0, 0]] * 2, atol=1e-12)
    write_gltf(clip, tmp_path / "clip.glb", options)
    document = gltf_reader.read(tmp_path / "clip.glb")
    _, turns = document.channels()[document.node("door"), "rotation"]
    np.testing.assert_allclose(turns, [[0, 0, 0, 1]] * 2, atol=1e-6)
