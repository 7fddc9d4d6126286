import dataclasses
import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.clip import Clip, Rig, Skin, Tracks
from exporters.joint_limit import within_limit
from tests.helpers import clips


def with_twins(clip: Clip) -> Clip:
    """Double every joint but the root; each weight goes half to the twin, so nothing changes."""
    rig, tracks = clip.rig, clip.tracks
    order = [0, *np.repeat(np.arange(1, len(rig)), 2)]
    first = np.array([0, *range(1, 2 * len(rig) - 1, 2)])
    # Two influences a Gaussian are left, so that their twins fit in.
    weights = np.where(np.arange(4) < 2, clip.skin.weights, 0)
    weights /= weights.sum(axis=1, keepdims=True)
    ids = first[clip.skin.joint_ids[:, :2]]
    twins = np.where(ids > 0, ids + 1, 0)
    halves = np.where(ids > 0, weights[:, :2] / 2, 0)
    return dataclasses.replace(
        clip,
        rig=Rig(
            joint_names=tuple(f"{rig.joint_names[j]}.{k}" for k, j in enumerate(order)),
            parents=[-1 if p < 0 else first[p] for p in rig.parents[order]],
            rest_translations=rig.rest_translations[order],
            rest_quats_wxyz=rig.rest_quats_wxyz[order],
            part_ids=rig.part_ids[order],
        ),
        skin=Skin(
            joint_ids=np.concatenate([ids, twins], axis=1),
            weights=np.concatenate([weights[:, :2] - halves, halves], axis=1),
        ),
        tracks=Tracks(
            times_s=tracks.times_s,
            translations=tracks.translations[:, order],
            quats_wxyz=tracks.quats_wxyz[:, order],
        ),
    )


def largest_difference(one: Clip, other: Clip) -> float:
    times_s = one.tracks.times_s
    pairs = [(one.pose_at(t).positions, other.pose_at(t).positions) for t in times_s]
    return max(float(np.linalg.norm(a - b, axis=1).max()) for a, b in pairs)


def test_within_the_limit_nothing_changes():
    clip = clips.random()
    assert within_limit(clip, None) is clip
    assert within_limit(clip, 6) is clip


def test_joints_that_move_alike_are_merged_first_and_cost_nothing():
    clip = with_twins(clips.random(joints=6))
    clip.validate()
    assert len(clip.rig) == 11
    merged = within_limit(clip, 6)
    merged.validate()
    assert len(merged.rig) == 6
    assert largest_difference(clip, merged) < 1e-5


def test_one_joint_is_left_for_a_limit_of_one():
    merged = within_limit(clips.chain(), 1)
    merged.validate()
    assert merged.rig.joint_names == ("root",)
    np.testing.assert_array_equal(merged.pose_at(0.1).positions, clips.chain().splats.positions)


def test_the_log_says_what_it_costs(caplog):
    clip = clips.chain()
    with caplog.at_level(logging.WARNING):
        merged = within_limit(clip, 2)
    assert merged.rig.joint_names == ("root", "elbow")
    # The last Gaussian stays straight on the elbow, at (1, 1.5, 0) in place of (0.5, 1, 0).
    share = 100 * np.hypot(0.5, 0.5) / 2.0
    assert f"3 joints merged into 2; no Gaussian moves by more than {share:.2g} %" in caplog.text
    assert "--anchors 1" in caplog.text
    assert largest_difference(clip, merged) == pytest.approx(np.hypot(0.5, 0.5), abs=1e-6)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 1000), limit=st.integers(1, 11))
def test_every_limit_gives_a_valid_clip_whose_kept_joints_move_as_before(seed, limit):
    clip = clips.random(joints=12, gaussians=20, keys=3, seed=seed)
    merged = within_limit(clip, limit)
    merged.validate()
    assert len(merged.rig) == limit
    kept = [clip.rig.joint_names.index(name) for name in merged.rig.joint_names]
    for time_s in clip.tracks.times_s:
        before = clip.joint_matrices_at(time_s)[kept]
        np.testing.assert_allclose(merged.joint_matrices_at(time_s), before, atol=1e-12)
    used = np.where(clip.skin.weights > 0, clip.skin.joint_ids, 0)
    unchanged = np.isin(used, kept).all(axis=1)
    before, after = (c.pose_at(clip.tracks.times_s[-1]).positions for c in (clip, merged))
    np.testing.assert_allclose(after[unchanged], before[unchanged], atol=1e-6)
