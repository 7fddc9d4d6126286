"""Frames are solved once more, with an energy that lets go sooner."""

import dataclasses

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
from animator.types import Gaussians
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(4.5, size_px=96)
RENDERER = CpuRenderer()
CONFIG = LooseningConfig()
NEARER = torch.tensor([0.0, 0.0, 0.12])


@pytest.fixture(scope="module")
def box() -> Gaussians:
    return textured_box(1500)


class Lab:
    """A box that comes toward the camera, and frames that say that it has not moved."""

    def __init__(self, box: Gaussians):
        self.truth = box.posed(box.means + NEARER, box.quats_wxyz)
        moved = draw(RENDERER, self.truth, CAMERA)
        frames = filmed([draw(RENDERER, box, CAMERA), moved, moved])
        problem = ClipProblem(
            gaussians=box,
            anchors=build_anchors(box, target_count=30),
            frames=frames,
            cameras=(CAMERA,) * 3,
            renderer=RENDERER,
            matcher=load_matcher("flow"),
            seed=0,
        )
        solver = ImageSolverConfig(pace=PaceConfig(most_steps=60))
        config = DriverConfig(use_matches=False, image_solver=solver)
        self.driver = Driver(problem, config)
        rest = self.driver.first()
        moving = dataclasses.replace(rest, stats=dataclasses.replace(rest.stats, start="previous"))
        held = dataclasses.replace(rest, stats=dataclasses.replace(rest.stats, start="held"))
        self.solved = [rest, moving, held]

    def error(self, frame: SolvedFrame) -> float:
        """Mean error, as a share of the motion."""
        anchors = self.driver.problem.anchors
        posed = anchors.positions + frame.poses.translations
        wanted = anchors.positions + NEARER
        return float((posed - wanted).norm(dim=1).mean() / NEARER.norm())


def test_what_moved_is_solved_again_what_is_held_follows_and_rest_stays(box):
    lab = Lab(box)
    rest, moving, held = loosened(lab.solved, lab.driver, CONFIG)
    assert rest.poses is lab.solved[0].poses
    assert lab.error(moving) < 0.5 * lab.error(lab.solved[1])
    assert held.poses is moving.poses
    assert "loosening" in moving.stats.seconds
    assert "loosening" not in held.stats.seconds


def test_looser_joints_leave_more_of_a_motion_in_depth(box):
    lab = Lab(box)
    tight = LooseningConfig(floor=1.0, rest=1.0)
    errors = [lab.error(loosened(lab.solved, lab.driver, c)[1]) for c in (CONFIG, tight)]
    assert errors[0] < 0.8 * errors[1]


def test_switched_off_every_pose_stays(box):
    lab = Lab(box)
    kept = loosened(lab.solved, lab.driver, LooseningConfig(is_on=False))
    assert [frame.poses for frame in kept] == [frame.poses for frame in lab.solved]


def test_looser_is_relative_to_what_the_clip_was_solved_with():
    solver = ImageSolverConfig(
        arap_norm=RobustNorm(reach=0.2, floor=0.5), weights=LossWeights(rest=12.0, arap=7.0)
    )
    looser = loose(solver, LooseningConfig(floor=0.5, rest=0.25))
    assert looser.arap_norm == RobustNorm(reach=0.2, floor=0.25)
    assert looser.weights == LossWeights(rest=3.0, arap=7.0)
