"""Smoothing of solved tracks."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.sequence.smoothing import (
    SmoothingConfig,
    beliefs_in,
    firmer_across_rays,
    smooth_tracks,
)
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.types import AnchorPoses, Anchors, AnchorUncertainty, RigidGroups
from tests.helpers.objects import front_camera
from tests.helpers.textured import textured_box

FRAMES, ANCHORS, DIAGONAL = 16, 3, 2.0


def tracks_of(shifts: np.ndarray, angles_rad: np.ndarray | None = None) -> list[AnchorPoses]:
    """Tracks from translations (T, A, 3) and turns about +z (T,)."""
    angles_rad = np.zeros(len(shifts)) if angles_rad is None else angles_rad
    turns = Rotation.from_rotvec(np.outer(angles_rad, (0, 0, 1))).as_quat(scalar_first=True)
    return [
        AnchorPoses(
            quats_wxyz=torch.as_tensor(np.tile(turn, (shift.shape[0], 1)), dtype=torch.float32),
            translations=torch.as_tensor(shift, dtype=torch.float32),
        )
        for shift, turn in zip(shifts, turns, strict=True)
    ]


def shifts_of(tracks: list[AnchorPoses]) -> np.ndarray:
    return np.stack([pose.translations.numpy() for pose in tracks])


def at_rest(anchors: Anchors) -> SolvedFrame:
    return SolvedFrame(
        poses=AnchorPoses.identity(anchors),
        camera=front_camera(1e4),
        groups=RigidGroups(labels=np.zeros(0, np.int64)),
        stats=FrameStats(matches=0, reprojection_px=0.0, start="rest", groups=0, seconds={}),
    )


def line() -> np.ndarray:
    times = np.arange(FRAMES)[:, None, None]
    return times * np.array([[0.02, 0.0, 0.01], [0.0, 0.03, 0.0], [0.0, 0.0, 0.0]])


def tremble() -> np.ndarray:
    noise = np.random.default_rng(0).normal(0, 5e-4 * DIAGONAL, (FRAMES, ANCHORS, 3))
    noise[0] = 0.0
    return noise


def test_even_motion_stays():
    smooth = shifts_of(smooth_tracks(tracks_of(line()), DIAGONAL, SmoothingConfig()))
    np.testing.assert_allclose(smooth, line(), atol=1e-6)


def test_tremble_goes_and_comes_nearer_to_the_truth():
    noisy = line() + tremble()
    smooth = shifts_of(smooth_tracks(tracks_of(noisy), DIAGONAL, SmoothingConfig()))
    acceleration = np.abs(np.diff(smooth, 2, axis=0)).mean()
    assert acceleration < 0.2 * np.abs(np.diff(noisy, 2, axis=0)).mean()
    assert np.abs(smooth - line()).mean() < 0.7 * np.abs(noisy - line()).mean()


def test_a_real_start_is_not_rounded_off():
    sudden = line()
    sudden[:8] = 0.0
    sudden[8:] += 0.2  # a tenth of the diagonal in one frame
    robust = shifts_of(smooth_tracks(tracks_of(sudden), DIAGONAL, SmoothingConfig()))
    plain = SmoothingConfig(reach=float("inf"))
    rounded = shifts_of(smooth_tracks(tracks_of(sudden), DIAGONAL, plain))
    assert np.abs(robust - sudden).max() < 0.2 * np.abs(rounded - sudden).max()


def test_the_first_frame_stays_exactly():
    tracks = tracks_of(line() + 0.3 + tremble())
    smooth = smooth_tracks(tracks, DIAGONAL, SmoothingConfig())
    assert smooth[0] is tracks[0]


@pytest.mark.parametrize("frames", [1, 2])
def test_too_few_frames_to_have_an_acceleration(frames):
    tracks = tracks_of(line()[:frames])
    assert smooth_tracks(tracks, DIAGONAL, SmoothingConfig()) == tracks


def test_rotations_stay_unit_and_even_turns_stay_whatever_their_signs():
    angles_rad = np.linspace(0, 1.5, FRAMES)
    tracks = tracks_of(line(), angles_rad)
    tracks[5] = AnchorPoses(quats_wxyz=-tracks[5].quats_wxyz, translations=tracks[5].translations)
    for pose, angle_rad in zip(
        smooth_tracks(tracks, DIAGONAL, SmoothingConfig()), angles_rad, strict=True
    ):
        torch.testing.assert_close(pose.quats_wxyz.norm(dim=1), torch.ones(ANCHORS))
        assert 2 * np.arccos(min(abs(float(pose.quats_wxyz[0, 0])), 1.0)) == pytest.approx(
            angle_rad, abs=2e-3
        )


def test_zero_strength_leaves_the_tracks():
    tracks = tracks_of(line() + tremble())
    assert smooth_tracks(tracks, DIAGONAL, SmoothingConfig(strength=0.0)) == tracks


def test_what_is_believed_less_is_smoothed_more_and_only_in_that_direction():
    noisy = line() + tremble()
    beliefs = np.tile(np.diag([1.0, 1.0, 0.1]), (FRAMES, ANCHORS, 1, 1))
    # A robust norm would couple the directions.
    squares = SmoothingConfig(reach=float("inf"), strength=1.0)
    alike = shifts_of(smooth_tracks(tracks_of(noisy), DIAGONAL, squares))
    weighted = shifts_of(smooth_tracks(tracks_of(noisy), DIAGONAL, squares, beliefs))
    moved_alike, moved = (np.abs(found - noisy).mean(axis=(0, 1)) for found in (alike, weighted))
    np.testing.assert_allclose(moved[:2], moved_alike[:2], rtol=1e-4)
    assert moved[2] > 1.1 * moved_alike[2]


def test_firmer_is_across_the_ray_only():
    anchors = build_anchors(textured_box(), target_count=20)
    frame = at_rest(anchors)
    beliefs = np.tile(0.1 * np.eye(3), (len(anchors), 1, 1))
    factors = np.linspace(1.0, 4.0, len(anchors))
    firmer = firmer_across_rays(beliefs, frame, anchors, factors)
    for factor, belief in zip(factors, firmer, strict=True):
        np.testing.assert_allclose(
            np.linalg.eigvalsh(belief), [0.1, 0.1 * factor, 0.1 * factor], atol=1e-12
        )


def test_a_jump_is_rounded_off_only_where_it_is_not_believed():
    jump = line()
    jump[:4] += 0.4  # a fifth of the diagonal, as of a limb that is lost until frame 4
    doubt = np.tile(np.eye(3), (FRAMES, ANCHORS, 1, 1))
    doubt[:4] *= SmoothingConfig().least_belief
    believed, doubted = (
        np.diff(
            shifts_of(smooth_tracks(tracks_of(jump), DIAGONAL, SmoothingConfig(), known)), 2, axis=0
        )
        for known in (None, doubt)
    )
    assert np.abs(believed).max() > 0.9 * 0.4
    assert np.abs(doubted).max() < 0.85 * np.abs(believed).max()


@pytest.mark.parametrize(("axis", "remains"), [(0, (0.9, 1.0)), (2, (0.0, 0.4))])
def test_a_jump_in_a_direction_that_nothing_shows_is_no_jump(axis, remains):
    jump = line()
    jump[8:, :, axis] += 0.4
    beliefs = np.tile(np.diag([1.0, 1.0, SmoothingConfig().least_belief]), (FRAMES, ANCHORS, 1, 1))
    smooth = shifts_of(smooth_tracks(tracks_of(jump), DIAGONAL, SmoothingConfig(), beliefs))
    acceleration = np.abs(np.diff(smooth, 2, axis=0)).max() / 0.4
    assert remains[0] < acceleration < remains[1]


def test_belief_is_less_along_the_ray_and_where_nothing_is_seen():
    anchors = build_anchors(textured_box(), target_count=20)
    count, config = len(anchors), SmoothingConfig(believed=0.01, least_belief=0.25)
    sigmas = {"along_ray": 0.02 * DIAGONAL, "across_ray": 0.005 * DIAGONAL}
    uncertainty = AnchorUncertainty(
        **{name: np.full(count, sigma, np.float32) for name, sigma in sigmas.items()}
    )
    frame = at_rest(anchors)
    believed, doubted = beliefs_in(
        [frame, dataclasses.replace(frame, uncertainty=uncertainty)], anchors, DIAGONAL, config
    )
    np.testing.assert_array_equal(believed, np.tile(np.eye(3), (count, 1, 1)))
    ray = anchors.positions[0].numpy() - frame.camera.position
    ray /= np.linalg.norm(ray)
    np.testing.assert_allclose(ray @ doubted[0] @ ray, 0.25, atol=1e-6)
    np.testing.assert_allclose(np.linalg.eigvalsh(doubted[0]), [0.25, 1.0, 1.0], atol=1e-6)
