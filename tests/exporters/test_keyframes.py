import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from exporters import keyframes, quaternions
from tests.helpers import clips


@settings(derandomize=True, max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), keys=st.integers(1, 6))
def test_continued_signs_keep_rotations_and_never_jump(seed, keys):
    rng = np.random.default_rng(seed)
    quats_wxyz = quaternions.normalize(rng.normal(size=(keys, 3, 4)))
    continuous = keyframes.continue_signs(quats_wxyz)
    np.testing.assert_array_equal(np.abs(continuous), np.abs(quats_wxyz))
    np.testing.assert_array_equal(
        quaternions.to_matrices(continuous), quaternions.to_matrices(quats_wxyz)
    )
    np.testing.assert_array_equal(continuous[0], quats_wxyz[0])
    assert (np.sum(continuous[1:] * continuous[:-1], axis=-1) >= 0).all()


@settings(derandomize=True, max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_quaternions_of_matrices_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    half_turns = np.eye(4)[1:]  # where the trace is -1 and the simplest formula divides by zero
    quats_wxyz = np.concatenate([quaternions.normalize(rng.normal(size=(5, 4))), half_turns])
    rotations = Rotation.from_quat(quats_wxyz, scalar_first=True)
    found = quaternions.from_matrices(rotations.as_matrix())
    assert (found[:, 0] >= 0).all()
    np.testing.assert_allclose(np.abs(np.sum(found * quats_wxyz, axis=1)), 1.0, atol=1e-12)
    np.testing.assert_allclose(
        quaternions.to_matrices(quats_wxyz), rotations.as_matrix(), atol=1e-12
    )


def test_keys_lie_on_whole_codes_in_spite_of_rounding():
    clip = clips.chain()
    tracks = dataclasses.replace(clip.tracks, times_s=np.array([0, 29, 58]) / 29.97)
    clip = dataclasses.replace(clip, tracks=tracks, fps=29.97)
    assert keyframes.key_codes(clip).tolist() == [0, 29, 58]
    assert keyframes.frame_count(clip) == 59


def test_a_last_key_between_frames_gets_a_frame():
    clip = clips.chain()
    tracks = dataclasses.replace(clip.tracks, times_s=[0.0, 0.05, 0.1])  # codes 0, 1.2, 2.4
    assert keyframes.frame_count(dataclasses.replace(clip, tracks=tracks)) == 4


def test_values_are_held_outside_the_keys_and_exact_on_them():
    tracks = clips.random().tracks
    for time_s, key in ((-1.0, 0), (tracks.times_s[2], 2), (1e9, -1)):
        translations, quats_wxyz = keyframes.interpolate(tracks, time_s)
        np.testing.assert_array_equal(translations, tracks.translations[key])
        np.testing.assert_array_equal(quats_wxyz, tracks.quats_wxyz[key])
