"""Rigid pieces: found where the motion is rigid, split where it is not."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from exporters import rigid_parts
from exporters.clip import Clip, Rig, Skin, Tracks
from exporters.rigid_parts import fit_parts
from tests.helpers import clips


def blocks(*, part_ids: list[int], angle_rad: float, seed: int = 0) -> Clip:
    """Two blocks of 40 Gaussians, each on its own joint; the second turns about (2, 0, 0)."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-0.5, 0.5, (80, 3))
    positions[40:] += [2.0, 0.0, 0.0]
    rest = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    axis = rng.normal(size=3)
    turn = Rotation.from_rotvec(angle_rad * axis / np.linalg.norm(axis)).as_quat(scalar_first=True)
    still = [clips.IDENTITY] * 3
    return dataclasses.replace(
        clips.static(),
        splats=clips.splats(positions),
        rig=Rig(
            joint_names=("root", "left", "right"),
            parents=[-1, 0, 0],
            rest_translations=rest,
            rest_quats_wxyz=still,
            part_ids=part_ids,
        ),
        skin=clips.skin_to([1] * 40 + [2] * 40),
        tracks=Tracks(
            times_s=[0.0, 4 / 24],
            translations=[rest, rest + np.array([[0, 0, 0], [0, 0, 0], [0.3, 0.2, 0.1]])],
            quats_wxyz=[still, [*still[:2], turn]],
        ),
        source_frames=(),
    )


@settings(derandomize=True, max_examples=10, deadline=None)
@given(angle_rad=st.floats(0.1, 3.0), seed=st.integers(0, 1000))
def test_true_parts_are_followed_exactly(angle_rad, seed):
    clip = blocks(part_ids=[-1, 0, 1], angle_rad=angle_rad, seed=seed)
    parts = fit_parts(clip)
    assert parts.names == ("part_0", "part_1")
    assert [len(members) for members in parts.members] == [40, 40]
    assert parts.error.max_percent < 1e-3
    expected = Rotation.from_quat(clip.tracks.quats_wxyz[-1, 2], scalar_first=True)
    found = Rotation.from_quat(parts.quats_wxyz[-1, 1], scalar_first=True)
    assert (found * expected.inv()).magnitude() < 1e-5


@pytest.mark.parametrize(
    ("part_id", "names"), [(5, ("part_5_0", "part_5_1")), (-1, ("free_0", "free_1"))]
)
def test_what_moves_apart_is_split(part_id, names):
    parts = fit_parts(blocks(part_ids=[part_id] * 3, angle_rad=1.0))
    assert parts.names == names
    np.testing.assert_array_equal(parts.members[0], np.arange(40))
    np.testing.assert_array_equal(parts.members[1], np.arange(40, 80))
    assert parts.error.max_percent < 1e-3


def test_what_moves_together_is_not_split():
    clip = blocks(part_ids=[0, 0, 0], angle_rad=0.0)
    still = dataclasses.replace(
        clip.tracks, translations=np.tile(clip.rig.rest_translations, (2, 1, 1))
    )
    parts = fit_parts(dataclasses.replace(clip, tracks=still))
    assert parts.names == ("part_0",)
    assert parts.error.max_percent < 1e-4


def test_every_gaussian_is_in_one_piece():
    clip = clips.random(gaussians=200, joints=10)
    parts = fit_parts(clip)
    np.testing.assert_array_equal(np.sort(np.concatenate(parts.members)), np.arange(200))


def test_the_fit_is_the_best_for_the_centers(monkeypatch):
    """Against scipy's Procrustes solver, with spreads too small to count."""
    clip = clips.random(gaussians=50, joints=4)
    clip = dataclasses.replace(
        clip, splats=dataclasses.replace(clip.splats, scales=np.full((50, 3), 1e-6))
    )
    monkeypatch.setattr(rigid_parts, "ERROR_BOUND", np.inf)
    parts = fit_parts(clip)
    for frame, time_s in enumerate(parts.times_s):
        posed = clip.pose_at(time_s).positions
        for index, members in enumerate(parts.members):
            if len(members) < 4:
                continue
            masses = clip.splats.opacities[members] + 1e-3
            rest, moved = clip.splats.positions[members], posed[members]
            best, _ = Rotation.align_vectors(
                moved - np.average(moved, axis=0, weights=masses),
                rest - np.average(rest, axis=0, weights=masses),
                weights=masses,
            )
            found = Rotation.from_quat(parts.quats_wxyz[frame, index], scalar_first=True)
            assert (found * best.inv()).magnitude() < 1e-4


def test_a_bending_part_is_split_until_it_is_within_the_bound(monkeypatch):
    """A strip bent by eight joints in a row: the finer the bound, the more pieces, the less off."""
    count, joints = 400, 8
    along = np.linspace(0, 8, count)
    rest = np.array([[0.0, 0.0, 0.0], *([[1.0, 0.0, 0.0]] * (joints - 1))])
    bend = Rotation.from_rotvec([0, 0, 0.2]).as_quat(scalar_first=True)
    base = np.clip(along.astype(int), 0, joints - 1)
    after = np.clip(base + 1, 0, joints - 1)
    share = np.where(after > base, along - base, 0.0) / 2
    zeros = np.zeros(count)
    clip = dataclasses.replace(
        clips.static(),
        splats=clips.splats(np.stack([along, zeros, 0.1 * np.sin(9 * along)], axis=1)),
        rig=Rig(
            joint_names=tuple(f"j{i}" for i in range(joints)),
            parents=range(-1, joints - 1),
            rest_translations=rest,
            rest_quats_wxyz=[clips.IDENTITY] * joints,
            part_ids=[-1] * joints,
        ),
        skin=Skin(
            joint_ids=np.stack([base, np.where(share > 0, after, 0), 0 * base, 0 * base], axis=1),
            weights=np.stack([1 - share, share, zeros, zeros], axis=1),
        ),
        tracks=Tracks(
            times_s=[0.0, 0.25],
            translations=[rest, rest],
            quats_wxyz=[[clips.IDENTITY] * joints, [bend] * joints],
        ),
        source_frames=(),
    )
    found = []
    for bound in (1.0, 0.03, 0.01):
        monkeypatch.setattr(rigid_parts, "ERROR_BOUND", bound)
        parts = fit_parts(clip)
        found.append((len(parts.names), parts.error.p95_percent))
        assert parts.error.p95_percent <= 100 * bound
    assert found[0][0] == 1
    assert found[0][0] < found[1][0] < found[2][0] <= joints
    assert found[0][1] > found[1][1] > found[2][1]
