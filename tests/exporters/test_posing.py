import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from exporters.clip import Clip, Splats
from tests.helpers import clips


def rotation(quat_wxyz: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.array(quat_wxyz, float), scalar_first=True)


def naive_pose(clip: Clip, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """The pose by one loop over joints and one over Gaussians, on scipy's rotations."""
    rig, tracks = clip.rig, clip.tracks
    time_s = float(np.clip(time_s, tracks.times_s[0], tracks.times_s[-1]))
    bind, posed = [], []
    for joint, parent in enumerate(rig.parents):
        if len(tracks) == 1:
            turn = rotation(tracks.quats_wxyz[0, joint])
        else:
            turn = Slerp(tracks.times_s.copy(), rotation(tracks.quats_wxyz[:, joint]))(time_s)
        moved = [
            np.interp(time_s, tracks.times_s, tracks.translations[:, joint, i]) for i in (0, 1, 2)
        ]
        local_rest = (rotation(rig.rest_quats_wxyz[joint]), rig.rest_translations[joint].copy())
        for world, (local_turn, local_shift) in ((bind, local_rest), (posed, (turn, moved))):
            parent_turn, parent_shift = world[parent] if parent >= 0 else (Rotation.identity(), 0.0)
            world.append((parent_turn * local_turn, parent_turn.apply(local_shift) + parent_shift))
    positions, quats_wxyz = [], []
    for i in range(len(clip.splats)):
        center, blend, reference = np.zeros(3), np.zeros(4), None
        for joint, weight in zip(clip.skin.joint_ids[i], clip.skin.weights[i], strict=True):
            if weight == 0:
                continue
            turn = posed[joint][0] * bind[joint][0].inv()
            local = bind[joint][0].inv().apply(clip.splats.positions[i] - bind[joint][1])
            center += weight * (posed[joint][0].apply(local) + posed[joint][1])
            quat_wxyz = turn.as_quat(scalar_first=True)
            reference = quat_wxyz if reference is None else reference
            blend += weight * np.copysign(1, quat_wxyz @ reference) * quat_wxyz
        positions.append(center)
        turned = rotation(blend) * rotation(clip.splats.quats_wxyz[i])
        quats_wxyz.append(turned.as_quat(scalar_first=True))
    return np.array(positions), np.array(quats_wxyz)


@pytest.mark.parametrize("make", clips.ALL.values(), ids=clips.ALL.keys())
@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 1.0, 1.5])
def test_pose_equals_a_naive_loop(make, share):
    clip = make()
    time_s = share * clip.tracks.times_s[-1]
    positions, quats_wxyz = naive_pose(clip, time_s)
    posed = clip.pose_at(time_s)
    np.testing.assert_allclose(posed.positions, positions, atol=2e-6)
    cosines = np.abs(np.sum(posed.quats_wxyz * quats_wxyz, axis=1))
    np.testing.assert_allclose(cosines, 1.0, atol=1e-6)
    assert posed.positions.dtype == posed.quats_wxyz.dtype == np.float32


def test_hinge_by_hand():
    half, end = (clips.hinge().pose_at(time_s) for time_s in (0.5, 1.0))
    root_half = np.sqrt(0.5)
    np.testing.assert_allclose(
        half.positions, [[0.5, 0, 0], [1 + root_half, root_half, 0], [1, 0, 0]], atol=1e-6
    )
    np.testing.assert_allclose(end.positions, [[0.5, 0, 0], [1, 1, 0], [1, 0, 0]], atol=1e-6)
    eighth = [np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)]
    expected = [clips.IDENTITY, clips.QUARTER_TURN_Z, eighth]
    np.testing.assert_allclose(end.quats_wxyz, expected, atol=1e-6)


def test_rest_tracks_leave_the_rest_pose():
    clip = clips.random()
    tracks = dataclasses.replace(
        clip.tracks,
        times_s=[0.0],
        translations=clip.rig.rest_translations[None],
        quats_wxyz=clip.rig.rest_quats_wxyz[None],
    )
    posed = dataclasses.replace(clip, tracks=tracks).pose_at(0.0)
    np.testing.assert_allclose(posed.positions, clip.splats.positions, atol=1e-6)
    np.testing.assert_allclose(posed.quats_wxyz, clip.splats.quats_wxyz, atol=1e-6)


def test_the_turn_is_applied_on_the_left():
    clip = clips.hinge()
    quarter_turn_x = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
    splats = dataclasses.replace(clip.splats, quats_wxyz=np.tile(quarter_turn_x, (3, 1)))
    posed = dataclasses.replace(clip, splats=splats).pose_at(1.0)
    # First about x, then about the world's z: (1 + k)(1 + i) / 2 = (1 + i + j + k) / 2.
    np.testing.assert_allclose(posed.quats_wxyz[1], [0.5, 0.5, 0.5, 0.5], atol=1e-6)


def test_opposite_signs_of_one_rotation_do_not_cancel():
    clip = clips.hinge()
    end = clip.tracks.quats_wxyz.copy()
    end[:, 1] *= -1.0  # the same rotations, the other sign
    flipped = dataclasses.replace(clip, tracks=dataclasses.replace(clip.tracks, quats_wxyz=end))
    for time_s in (0.0, 0.5, 1.0):
        expected, posed = clip.pose_at(time_s), flipped.pose_at(time_s)
        np.testing.assert_allclose(posed.positions, expected.positions, atol=1e-6)
        np.testing.assert_allclose(posed.quats_wxyz, expected.quats_wxyz, atol=1e-6)


def test_joint_matrices_by_hand():
    matrices = clips.chain().joint_matrices_at(3 / 24)
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(matrices[1, :3, :3], quarter, atol=1e-12)
    np.testing.assert_allclose(matrices[2, :3, 3], [1, 1, 0], atol=1e-12)
    np.testing.assert_allclose(matrices[2, :3, :3], quarter @ quarter, atol=1e-12)
    np.testing.assert_allclose(clips.chain().bind_matrices()[2, :3, 3], [2, 0, 0], atol=0)


def sampled_extent(clip: Clip, time_s: float) -> np.ndarray:
    """The box around many points on every 3-sigma ellipsoid: from inside, never too large."""
    posed = clip.pose_at(time_s)
    rng = np.random.default_rng(3)
    sphere = rng.normal(size=(4000, 3))
    sphere *= 3.0 / np.linalg.norm(sphere, axis=1, keepdims=True)
    points = [
        rotation(posed.quats_wxyz[i]).apply(sphere * clip.splats.scales[i]) + posed.positions[i]
        for i in range(len(clip.splats))
    ]
    return np.stack([np.min(points, axis=(0, 1)), np.max(points, axis=(0, 1))])


def test_extent_is_the_tight_box_of_the_three_sigma_ellipsoids():
    clip = clips.random()
    tight, inside = clip.extent_at(0.1), sampled_extent(clip, 0.1)
    assert (tight[0] <= inside[0]).all()
    assert (tight[1] >= inside[1]).all()
    np.testing.assert_allclose(tight, inside, atol=2e-3)


def test_extent_of_one_turned_ellipsoid_by_hand():
    eighth_z = [np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)]
    splats = Splats(
        positions=[[1.0, 2.0, 3.0]],
        quats_wxyz=[eighth_z],
        scales=[[0.3, 0.4, 0.1]],
        opacities=[0.5],
        sh_coeffs=np.zeros((1, 1, 3)),
    )
    clip = dataclasses.replace(clips.static(), splats=splats, skin=clips.skin_to([0]))
    side = 3 * np.sqrt((0.09 + 0.16) / 2)
    expected = [[1 - side, 2 - side, 3 - 0.3], [1 + side, 2 + side, 3 + 0.3]]
    np.testing.assert_allclose(clip.extent_at(0.0), expected, rtol=1e-6)
