import dataclasses

import numpy as np
import pytest

from animator.evaluation.motion_scores import PointTracks, score_motion

DIAGONAL = 2.0
CAMERA = np.array([0.0, 0.0, -5.0])


def rest_points(count: int = 80) -> np.ndarray:
    """Points all around the origin: for each, its mirror images too."""
    octant = np.random.default_rng(0).uniform(0.1, 1.0, (count // 8, 3))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return (octant[:, None] * signs).reshape(-1, 3)


def tracks(true: np.ndarray, found: np.ndarray, **changes) -> PointTracks:
    """Everything seen and outer, one rigid part, frame 0 given."""
    frames, count = true.shape[:2]
    made = PointTracks(
        numbers=tuple(range(frames)),
        is_scored=np.arange(frames) > 0,
        rest=true[0],
        true=true,
        found=found,
        is_seen=np.ones((frames, count), bool),
        is_outer=np.ones(count, bool),
        part_ids=np.zeros(count, np.int64),
        part_names=("body",),
        has_rigid_parts=True,
        camera_positions=np.tile(CAMERA, (frames, 1)),
        diagonal=DIAGONAL,
    )
    return dataclasses.replace(made, **changes)


def sliding(frames: int = 3, step: float = 0.5) -> np.ndarray:
    return np.stack([rest_points() + np.array([step * k, 0, 0]) for k in range(frames)])


def test_the_truth_itself_is_perfect_and_the_rest_pose_captures_nothing():
    true = sliding()
    perfect = score_motion(tracks(true, true))
    assert perfect.all.captured == 1.0
    assert perfect.all.epe_percent == 0.0
    still = score_motion(tracks(true, np.tile(true[0], (3, 1, 1))))
    assert still.all.captured == 0.0
    # Frames 1 and 2 moved by .5 and 1 of a diagonal of 2: 25 and 50 %.
    assert still.all.epe_percent == pytest.approx(37.5)
    assert [frame.all.epe_percent for frame in still.frames] == pytest.approx([25.0, 50.0])
    assert [frame.number for frame in still.frames] == [1, 2]


def test_an_error_along_the_ray_is_depth_and_nothing_else():
    true = sliding()
    rays = (true - CAMERA) / np.linalg.norm(true - CAMERA, axis=-1, keepdims=True)
    scores = score_motion(tracks(true, true + 0.1 * rays)).all
    assert scores.depth_percent == pytest.approx(5.0)
    assert scores.lateral_percent == pytest.approx(0.0, abs=1e-9)
    # Sum of errors .1 + .1 over sum of motion .5 + 1.
    assert scores.captured == pytest.approx(1 - 0.2 / 1.5)


def test_an_error_across_the_ray_is_lateral_and_nothing_else():
    true = sliding()
    rays = true - CAMERA
    across = np.cross(rays, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    scores = score_motion(tracks(true, true + 0.04 * across)).all
    assert scores.lateral_percent == pytest.approx(2.0)
    assert scores.depth_percent == pytest.approx(0.0, abs=1e-9)


def test_seen_and_unseen_and_inner_points_are_kept_apart():
    true = sliding()
    count = true.shape[1]
    found = true.copy()
    is_seen = np.zeros((3, count), bool)
    is_seen[:, : count // 2] = True
    is_outer = np.ones(count, bool)
    is_outer[-1] = False
    found[:, count // 2 :] = true[0, count // 2 :]
    found[:, -1] += 1e6
    scores = score_motion(tracks(true, found, is_seen=is_seen, is_outer=is_outer))
    assert scores.seen.captured == 1.0
    assert scores.unseen.captured == 0.0
    assert scores.all.captured == pytest.approx((count // 2) / (count - 1))


def test_any_rigid_motion_of_a_part_has_no_rigid_error_and_a_stretch_has_its_own():
    true = sliding()
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turned = np.stack([true[0], true[0] @ turn.T + [3, 2, 1], true[0]])
    assert score_motion(tracks(true, turned)).rigid_error_percent == pytest.approx(0, abs=1e-5)
    # By symmetry the best rigid fit of a stretch along x is none: what remains is .1 x.
    stretched = np.stack([true[0], true[0] * [1.1, 1, 1], true[0] * [1.1, 1, 1]])
    rms = 0.1 * np.sqrt(np.mean(true[0][:, 0] ** 2))
    scores = score_motion(tracks(true, stretched))
    assert scores.rigid_error_percent == pytest.approx(100 * rms / DIAGONAL)
    assert scores.parts[0].rigid_error_percent == pytest.approx(100 * rms / DIAGONAL)
    loose = score_motion(tracks(true, stretched, has_rigid_parts=False))
    assert np.isnan(loose.rigid_error_percent)


def test_each_part_has_its_own_error():
    true = sliding()
    part_ids = (true[0][:, 0] > 0).astype(np.int64)
    found = true.copy()
    found[:, part_ids == 1] = true[0, part_ids == 1]
    scores = score_motion(tracks(true, found, part_ids=part_ids, part_names=("left", "right")))
    assert [(part.name, part.points) for part in scores.parts] == [("left", 40), ("right", 40)]
    assert [part.all.captured for part in scores.parts] == [1.0, 0.0]


def test_jitter_compares_accelerations():
    # True: second difference .2 in x. Found: twice that.
    times = np.arange(5.0)
    true = rest_points() + 0.1 * times[:, None, None] ** 2 * [1.0, 0, 0]
    found = rest_points() + 0.2 * times[:, None, None] ** 2 * [0, 1.0, 0]
    assert score_motion(tracks(true, found)).jitter == pytest.approx(2.0)
    assert score_motion(tracks(true, true)).jitter == pytest.approx(1.0)
    assert np.isnan(score_motion(tracks(true[:2], found[:2])).jitter)


def test_a_still_truth_has_an_error_but_nothing_to_capture():
    true = np.tile(rest_points(), (3, 1, 1))
    scores = score_motion(tracks(true, true + np.array([0.02, 0, 0])))
    assert np.isnan(scores.all.captured)
    assert np.isnan(scores.jitter)
    assert scores.all.epe_percent == pytest.approx(1.0)
