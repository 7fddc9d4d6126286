"""Frames are solved once more, with an energy that lets go sooner."""

import dataclasses

import numpy as np
import pytest
import torch

from animator.deform.anchors import build_anchors
from animator.deform.image_solver import ImageSolverConfig, LossWeights
from animator.deform.pace import PaceConfig
from animator.deform.robust_norm import RobustNorm
from animator.match.registry import load_matcher
from animator.render.cpu import CpuRenderer
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.driver import Driver, DriverConfig
from animator.sequence.loosening import LooseningConfig, loose, loosened
from animator.sequence.solved_frame import SolvedFrame
from animator.types import AnchorPoses, Gaussians
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, fold, textured_box

CAMERA = front_camera(4.5, size_px=96)
RENDERER = CpuRenderer()
CONFIG = LooseningConfig(every=3, far=0.05)
NEARER = torch.tensor([0.0, 0.0, 0.12])


@pytest.fixture(scope="module")
def box() -> Gaussians:
    return textured_box(1500)


def nearer(box: Gaussians) -> Gaussians:
    return box.posed(box.means + NEARER, box.quats_wxyz)


class Lab:
    """A box that moves, toward the camera if nothing is said, and poses of it that say that it has not."""

    def __init__(self, box: Gaussians, starts: tuple[str, ...], moved: Gaussians | None = None):
        moved = moved or nearer(box)
        shown = [box if start == "rest" else moved for start in starts]
        problem = ClipProblem(
            gaussians=box,
            anchors=build_anchors(box, target_count=30),
            frames=filmed([draw(RENDERER, gaussians, CAMERA) for gaussians in shown]),
            cameras=(CAMERA,) * len(starts),
            renderer=RENDERER,
            matcher=load_matcher("flow"),
            seed=0,
        )
        solver = ImageSolverConfig(pace=PaceConfig(most_steps=60))
        self.driver = Driver(problem, DriverConfig(use_matches=False, image_solver=solver))
        rest = self.driver.first()
        self.solved = [
            dataclasses.replace(rest, stats=dataclasses.replace(rest.stats, start=start))
            for start in starts
        ]

    def loosened(self, config: LooseningConfig = CONFIG) -> list[SolvedFrame]:
        return loosened(self.solved, self.driver, config)

    def error(self, frame: SolvedFrame) -> float:
        """Mean error, as a share of the motion."""
        return float((frame.poses.translations - NEARER).norm(dim=1).mean() / NEARER.norm())


def was_solved(frames: list[SolvedFrame]) -> list[bool]:
    return ["loosening" in frame.stats.seconds for frame in frames]


def test_what_moved_is_solved_again_what_is_held_follows_and_rest_stays(box):
    lab = Lab(box, ("rest", "previous", "held"))
    rest, moving, held = frames = lab.loosened()
    assert was_solved(frames) == [False, True, False]
    assert rest.poses is lab.solved[0].poses
    assert lab.error(moving) < 0.5 * lab.error(lab.solved[1])
    assert held.poses is moving.poses


def test_frames_in_between_take_over_what_changed_around_them(box):
    lab = Lab(box, ("rest", *["previous"] * 4))
    frames = lab.loosened()
    assert was_solved(frames) == [False, False, False, True, True]
    found = [float(frame.poses.translations[:, 2].mean()) for frame in frames]
    np.testing.assert_allclose(found[1:3], [found[3] / 3, 2 * found[3] / 3], rtol=1e-5)


def test_after_a_large_step_a_frame_is_solved_itself(box):
    lab = Lab(box, ("rest", *["previous"] * 4))
    far = AnchorPoses(
        quats_wxyz=lab.solved[2].poses.quats_wxyz,
        translations=lab.solved[2].poses.translations + torch.tensor([0.0, 0.0, 0.2]),
    )
    for index in (2, 3, 4):
        lab.solved[index] = dataclasses.replace(lab.solved[index], poses=far)
    assert was_solved(lab.loosened()) == [False, False, True, False, True]


def test_free_joints_let_a_bend_in_depth_be_as_large_as_it_is(box):
    truth, _ = fold(box.means, 40.0)
    lab = Lab(box, ("rest", "previous"), moved=box.posed(truth, box.quats_wxyz))
    anchors = lab.driver.problem.anchors.positions
    places, quats_wxyz = fold(anchors, 30.0)
    bent_too_little = AnchorPoses(quats_wxyz=quats_wxyz, translations=places - anchors)
    lab.solved[1] = dataclasses.replace(lab.solved[1], poses=bent_too_little)
    tight = LooseningConfig(floor=1.0, arap=1.0)
    errors = []
    for config in (CONFIG, tight):
        posed = lab.driver._image_solver.pose(lab.loosened(config)[1].poses)
        errors.append(float((posed.means - truth).norm(dim=1).mean()))
    assert errors[0] < 0.5 * errors[1]


def test_a_frame_is_matched_anew_before_it_is_solved(box, monkeypatch):
    lab = Lab(box, ("rest", "previous"))
    matched, asked = lab.driver.matched_target_of, []

    def noted(index: int, frame: SolvedFrame):
        asked.append((index, frame))
        return matched(index, frame)

    monkeypatch.setattr(lab.driver, "matched_target_of", noted)
    lab.loosened()
    assert asked == [(1, lab.solved[1])]


def test_switched_off_every_pose_stays(box):
    lab = Lab(box, ("rest", "previous"))
    kept = lab.loosened(LooseningConfig(every=0))
    assert [frame.poses for frame in kept] == [frame.poses for frame in lab.solved]


def test_looser_is_relative_to_what_the_clip_was_solved_with():
    solver = ImageSolverConfig(
        arap_norm=RobustNorm(reach=0.2, floor=0.5), weights=LossWeights(rest=12.0, arap=7.0)
    )
    looser = loose(solver, LooseningConfig(floor=0.5, arap=2.0, rotation=0.5, rgb=3.0, deform=2.0))
    assert looser.arap_norm == RobustNorm(reach=0.2, floor=0.25)
    assert looser.weights == LossWeights(rest=12.0, arap=14.0, rotation=2.5, rgb=3.0, deform=0.6)
