import dataclasses
import re

import numpy as np
import pytest

from exporters.clip import Clip, ClipCamera, Rig
from exporters.errors import ClipError
from tests.helpers import clips


def with_part(clip: Clip, part: str, **fields: object) -> Clip:
    """Replace fields of one part; a callable is applied to a writable copy of the old array."""
    old = getattr(clip, part)
    for name, value in fields.items():
        if callable(value):
            fields[name] = array = np.array(getattr(old, name))
            value(array)
    return dataclasses.replace(clip, **{part: dataclasses.replace(old, **fields)})


def put(index: object, value: object):
    return lambda array: array.__setitem__(index, value)


def duplicate_joint(clip: Clip) -> Clip:
    return with_part(clip, "skin", joint_ids=put(0, [2, 2, 0, 0]), weights=put(0, [0.5, 0.5, 0, 0]))


BROKEN = {
    "name: expected some text": lambda c: dataclasses.replace(c, name=" "),
    "fps: expected a positive number, got 0": lambda c: dataclasses.replace(c, fps=0.0),
    "meters_per_unit: expected a positive number, got -1": lambda c: dataclasses.replace(
        c, meters_per_unit=-1.0
    ),
    "up_axis: expected 'Y' or 'Z', got 'X'": lambda c: dataclasses.replace(c, up_axis="X"),
    "source_frames: expected 0 or 3 numbers": lambda c: dataclasses.replace(c, source_frames=(1,)),
    "splats.sh_coeffs: expected shape (N, K, 3) with K": lambda c: with_part(
        c, "splats", sh_coeffs=np.zeros((3, 5, 3))
    ),
    "splats.quats_wxyz: expected shape (3, 4), got (3, 3)": lambda c: with_part(
        c, "splats", quats_wxyz=np.zeros((3, 3))
    ),
    "splats.positions: expected shape (N, 3) with N >= 1": lambda c: with_part(
        c, "splats", positions=np.zeros((0, 3))
    ),
    "splats.positions: 1 numbers that are not finite (first at (1, 2))": lambda c: with_part(
        c, "splats", positions=put((1, 2), np.nan)
    ),
    "splats.sh_coeffs: 1 numbers that are not finite": lambda c: with_part(
        c, "splats", sh_coeffs=put((0, 0, 0), np.inf)
    ),
    "splats.quats_wxyz: 1 quaternions that are not of unit length (first at 2)": lambda c: (
        with_part(c, "splats", quats_wxyz=put(2, [1, 1, 0, 0]))
    ),
    "splats.scales: 1 Gaussians with a scale <= 0 (first at 1)": lambda c: with_part(
        c, "splats", scales=put((1, 0), 0)
    ),
    "splats.opacities: 1 Gaussians outside 0..1; are these logits?": lambda c: with_part(
        c, "splats", opacities=put(0, 1.5)
    ),
    "tracks.times_s: expected shape (0,), got ()": lambda c: with_part(c, "tracks", times_s=0.0),
    "skin.joint_ids: 1 Gaussians with a joint outside 0..2": lambda c: with_part(
        c, "skin", joint_ids=put((1, 0), 3)
    ),
    "skin.weights: 1 Gaussians with a negative weight": lambda c: with_part(
        c, "skin", weights=put(0, [1.5, -0.5, 0, 0])
    ),
    "skin.weights: 1 Gaussians whose weights do not sum to 1": lambda c: with_part(
        c, "skin", weights=put(0, [0.9, 0, 0, 0])
    ),
    "skin.joint_ids: 1 Gaussians that follow one joint twice": duplicate_joint,
    "rig.joint_names: expected unique names, found more than once: ['elbow']": lambda c: with_part(
        c, "rig", joint_names=("root", "elbow", "elbow")
    ),
    "rig.joint_names: expected non-empty names": lambda c: with_part(
        c, "rig", joint_names=("root", "", "wrist")
    ),
    "rig.parents: expected exactly one root": lambda c: with_part(c, "rig", parents=put(2, -1)),
    "rig.parents: expected parents before children, not so at joints [1]": lambda c: with_part(
        c, "rig", parents=put(1, 2)
    ),
    "rig.rest_quats_wxyz: 1 quaternions that are not of unit": lambda c: with_part(
        c, "rig", rest_quats_wxyz=put(0, 0)
    ),
    "tracks.times_s: expected the first key at 0 s": lambda c: with_part(
        c, "tracks", times_s=[0.1, 0.2, 0.3]
    ),
    "tracks.times_s: 1 keys not later than the one before (first at 1)": lambda c: with_part(
        c, "tracks", times_s=[0.0, 0.2, 0.2]
    ),
    "tracks.quats_wxyz: 1 sign jumps between neighboring keys": lambda c: with_part(
        c, "tracks", quats_wxyz=lambda q: q.__setitem__((2, 1), -q[2, 1])
    ),
    "camera.cam_from_world: expected shape (1, 4, 4) or (3, 4, 4), got (2, 4, 4)": lambda c: (
        with_part(c, "camera", cam_from_world=np.tile(np.eye(4), (2, 1, 1)))
    ),
    "camera.cam_from_world: 1 poses that are not rigid": lambda c: with_part(
        c, "camera", cam_from_world=put((1, 0, 0), 2.0)
    ),
    "camera: expected width_px and height_px > 0, got 0 x 480": lambda c: with_part(
        c, "camera", width_px=0
    ),
    "camera.intrinsics: expected positive focal lengths": lambda c: with_part(
        c, "camera", intrinsics=put((1, 1), -650)
    ),
}


@pytest.mark.parametrize("make", clips.ALL.values(), ids=clips.ALL.keys())
def test_good_clips_pass(make):
    make().validate()


@pytest.mark.parametrize(("message", "damage"), BROKEN.items(), ids=BROKEN.keys())
def test_each_problem_is_named(message, damage):
    with pytest.raises(ClipError, match=re.escape(message)):
        damage(clips.chain()).validate()


def test_one_error_lists_all_problems():
    clip = dataclasses.replace(duplicate_joint(clips.chain()), fps=-1.0, name="")
    with pytest.raises(ClipError) as caught:
        clip.validate()
    message = str(caught.value)
    assert message.count("\n  - ") == 3
    assert all(word in message for word in ("name", "fps", "twice"))


def test_unused_influences_may_repeat_a_joint():
    clip = clips.chain()  # joint 0 with weight 0 fills every row, and the root uses joint 0
    assert (clip.skin.joint_ids == 0).sum(axis=1).max() == 4
    clip.validate()


def test_arrays_are_private_and_read_only():
    positions = np.zeros((3, 3), np.float32)
    splats = dataclasses.replace(clips.static().splats, positions=positions)
    positions[0] = 1.0
    assert splats.positions.sum() == 0.0
    with pytest.raises(ValueError, match="read-only"):
        splats.positions[0] = 1.0


def test_fractions_are_no_indices():
    with pytest.raises(ClipError, match=r"Rig\.parents: expected whole numbers"):
        Rig(
            joint_names=("a", "b"),
            parents=[-1, 0.5],
            rest_translations=np.zeros((2, 3)),
            rest_quats_wxyz=np.tile([1, 0, 0, 0], (2, 1)),
            part_ids=[0, 0],
        )


def test_text_is_no_array():
    with pytest.raises(ClipError, match=r"ClipCamera\.intrinsics: expected an array"):
        ClipCamera(cam_from_world=np.eye(4)[None], intrinsics="wide", width_px=1, height_px=1)
