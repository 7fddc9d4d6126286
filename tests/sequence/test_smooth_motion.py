"""A smooth motion is told from one with joints, and solved as what it is."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.coarse_motion import CoarseConfig
from animator.deform.image_solver import ImageSolverConfig, LossWeights
from animator.deform.pace import PaceConfig
from animator.deform.robust_norm import RobustNorm
from animator.deform.smooth_field import SmoothField, SmoothFieldConfig
from animator.match.registry import load_matcher
from animator.render.cpu import CpuRenderer
from animator.sequence.bare_solver import BareSolver
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.driver import Driver, DriverConfig
from animator.sequence.loosening import LooseningConfig
from animator.sequence.smooth_motion import (
    SmoothMotionConfig,
    moves_smoothly,
    on_finer_rig,
    smooth,
    solved_smoothly,
)
from animator.sequence.solved_frame import SolvedFrame
from animator.types import AnchorPoses, Gaussians
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, fold, textured_box

CAMERA = front_camera(4.5, size_px=96)
RENDERER = CpuRenderer()
CONFIG = SmoothMotionConfig(
    residual=0.2,
    worse=1.6,
    field=SmoothFieldConfig(coarse=CoarseConfig(nodes=(12, 1))),
    finer=1.0,
)
"""For a small box in small frames: the bend comes to .11 and 1.3, the fold to .16 and 2.0."""
FREE = LooseningConfig(pace=PaceConfig(most_steps=60))


@pytest.fixture(scope="module")
def box() -> Gaussians:
    return textured_box(1500)


def bend(points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Lower the ends along a parabola and move them away; return where points get to, and their turns."""
    x = points[:, :1]
    slopes = x.numpy() * [0.0, 0.3, -0.6]  # about y and z
    turns = torch.as_tensor(Rotation.from_rotvec(slopes).as_quat(scalar_first=True))
    return points + x**2 * torch.tensor([0.0, -0.3, -0.15]), turns.to(points)


class Lab:
    """A box that moves in some way, and poses of it that are right but for the depth of each anchor."""

    def __init__(self, box: Gaussians, move, starts: tuple[str, ...], noise: float = 0.01):
        moved = box.posed(move(box.means)[0], box.quats_wxyz)
        shown = [box if start == "rest" else moved for start in starts]
        anchors = build_anchors(box, target_count=60)
        problem = ClipProblem(
            gaussians=box,
            anchors=anchors,
            frames=filmed([draw(RENDERER, gaussians, CAMERA) for gaussians in shown]),
            cameras=(CAMERA,) * len(starts),
            renderer=RENDERER,
            matcher=load_matcher("flow"),
            seed=0,
        )
        solver = ImageSolverConfig(pace=PaceConfig(most_steps=60))
        self.driver = Driver(problem, DriverConfig(use_matches=False, image_solver=solver))
        places, quats_wxyz = move(anchors.positions)
        wrong = torch.from_numpy(np.random.default_rng(0).normal(0, noise, len(anchors))).float()
        places = places + wrong[:, None] * torch.tensor([0.0, 0.0, 1.0])
        poses = AnchorPoses(quats_wxyz=quats_wxyz, translations=places - anchors.positions)
        rest = self.driver.first()
        self.solved = [
            dataclasses.replace(
                rest,
                poses=rest.poses if start == "rest" else poses,
                stats=dataclasses.replace(rest.stats, start=start),
            )
            for start in starts
        ]

    def is_smooth(self, config: SmoothMotionConfig = CONFIG) -> bool:
        return moves_smoothly(self.solved, self.driver, config, FREE)

    def solve(self) -> list[SolvedFrame]:
        return solved_smoothly(self.solved, self.driver, CONFIG, FREE)

    def roughness(self, frame: SolvedFrame) -> float:
        """Mean distance of the anchors from the nearest smooth pose."""
        field = SmoothField(self.driver.problem.anchors, 1.0, CONFIG.field)
        near = field.near(frame.poses, CAMERA).translations
        return float((near - frame.poses.translations).norm(dim=1).mean())

    def image_loss(self, frame: SolvedFrame) -> float:
        return self.driver.image_loss(1, frame)


def test_a_smooth_bend_is_solved_as_one(box):
    lab = Lab(box, bend, ("rest", "previous", "held"))
    assert lab.is_smooth()
    rest, moving, held = lab.solve()
    assert rest.poses is lab.solved[0].poses
    assert "smooth motion" in moving.stats.seconds
    assert held.poses is moving.poses
    assert lab.roughness(moving) < 0.2 * lab.roughness(lab.solved[1])
    assert lab.image_loss(moving) < 0.8 * lab.image_loss(lab.solved[1])


def test_the_time_of_each_round_counts(box):
    lab = Lab(box, bend, ("rest", "previous"))
    stats = lab.solved[1].stats.with_time({"image": 1.0, "smooth motion": 1000.0})
    lab.solved[1] = dataclasses.replace(lab.solved[1], stats=stats)
    seconds = lab.solve()[1].stats.seconds
    assert seconds["image"] == 1.0
    assert seconds["smooth motion"] > 1000.0


def test_tracks_that_are_not_smooth_are_not_tried(box, monkeypatch):
    lab = Lab(box, bend, ("rest", "previous"), noise=0.05)
    monkeypatch.setattr(lab.driver, "matched_target_of", pytest.fail)
    assert not lab.is_smooth()


def test_a_joint_is_told_by_what_hidden_cells_show(box):
    lab = Lab(box, lambda points: fold(points, 50.0), ("rest", "previous"), noise=0.0)
    assert not lab.is_smooth()
    assert lab.is_smooth(dataclasses.replace(CONFIG, worse=1e9))


def test_what_was_hidden_from_a_solver_judges_it(box, monkeypatch):
    shown, judged = [], []

    def solve(self, target, start):
        shown.append(target.counted)
        return start

    def image_loss(self, target, poses):
        judged.append(target.counted)
        return 1.0 if len(judged) % 2 else 0.5

    monkeypatch.setattr(BareSolver, "solve", solve)
    monkeypatch.setattr(
        BareSolver, "solve_smoothly", lambda self, field, target, start: solve(self, target, start)
    )
    monkeypatch.setattr(BareSolver, "image_loss", image_loss)
    lab = Lab(box, bend, ("rest", "previous"))
    learned = []
    monkeypatch.setattr(lab.driver.light_stage, "learn_afresh", learned.append)
    assert not lab.is_smooth()  # Judged twice as bad as free joints.
    assert learned == [lab.solved]
    assert len(judged) == 4
    for fitted, other in zip(shown, judged, strict=True):
        torch.testing.assert_close(fitted + other, torch.ones_like(fitted))


def test_a_smooth_motion_is_held_together_more_than_free_joints():
    free = ImageSolverConfig(weights=LossWeights(rest=12.0, arap=7.0))
    config = dataclasses.replace(CONFIG, arap=3.0, rest=2.0)
    assert smooth(free, config).weights == LossWeights(rest=24.0, arap=21.0)


def test_a_bend_costs_on_a_finer_rig_what_it_costs_on_a_coarse_one():
    coarse = ImageSolverConfig(arap_norm=RobustNorm(reach=0.004, floor=0.01))
    fine = on_finer_rig(coarse, 3.0)
    residuals = torch.tensor([1e-4, 1e-3, 4e-3, 0.02, 0.3])
    on_coarse, on_fine = (
        solver.weights.arap * solver.arap_norm.cost(squared)
        for solver, squared in ((coarse, residuals**2), (fine, (residuals / 3.0) ** 2))
    )
    torch.testing.assert_close(on_fine, on_coarse)


def test_the_solver_knows_how_fine_its_rig_is(box, monkeypatch):
    lab = Lab(box, bend, ("rest", "previous"))
    reaches = []

    def solve_smoothly(self, field, target, start):
        reaches.append(self.config.arap_norm.reach)
        return start

    monkeypatch.setattr(BareSolver, "solve_smoothly", solve_smoothly)
    for finer in (1.0, 2.0):
        solved_smoothly(lab.solved, lab.driver, dataclasses.replace(CONFIG, finer=finer), FREE)
    assert reaches[1] == reaches[0] / 2.0


def test_one_body_is_left_alone(box):
    def shift(points: torch.Tensor):
        quats_wxyz = torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(len(points), 1)
        return points + torch.tensor([0.1, 0.0, 0.1]), quats_wxyz

    assert not Lab(box, shift, ("rest", "previous"), noise=0.0).is_smooth()


def test_nothing_that_moves_and_switched_off(box):
    assert not Lab(box, bend, ("rest", "rest")).is_smooth()
    off = dataclasses.replace(CONFIG, residual=0.0)
    assert not Lab(box, bend, ("rest", "previous")).is_smooth(off)
