import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.image_solver import ImageSolver, ImageSolverConfig
from animator.deform.pace import PaceConfig
from animator.match.unexplained import Piece
from animator.render.cpu import CpuRenderer
from animator.sequence.limb_search import (
    LimbSearch,
    LimbSearchConfig,
    is_badly_explained,
    is_far,
)
from animator.sequence.sketch import Sketcher
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.sequence.target import FrameView, Window
from animator.sequence.view_colors import ViewColors
from animator.types import AnchorPoses, Gaussians, RigidGroups
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(4.5, size_px=96)
RENDERER = CpuRenderer()
STATS = FrameStats(matches=0, reprojection_px=0.0, start="previous", groups=0, seconds={})
CONFIG = LimbSearchConfig(most_swings=1)
SOLVER = ImageSolverConfig(pace=PaceConfig(most_steps=60))


@pytest.fixture(scope="module")
def armed() -> Gaussians:
    """A textured body with a textured arm to the right of it."""
    body, arm = textured_box(1500, seed=0), textured_box(500, seed=1)
    places = arm.means * torch.tensor([0.8, 0.25, 0.3]) + torch.tensor([1.2, 0.2, 0.0])
    fields = {
        field.name: torch.cat([getattr(body, field.name), getattr(arm, field.name)])
        for field in dataclasses.fields(Gaussians)
    }
    fields["means"] = torch.cat([body.means, places])
    return Gaussians(**fields)


def raised(gaussians: Gaussians, degrees: float) -> Gaussians:
    """The arm turned about its root in the picture."""
    turn = Rotation.from_euler("z", degrees, degrees=True)
    root = np.array([0.7, 0.2, 0.0])
    means = gaussians.means.numpy().astype(np.float64)
    means[1500:] = root + turn.apply(means[1500:] - root)
    return gaussians.posed(torch.as_tensor(means).float(), gaussians.quats_wxyz)


class Lab:
    """A solver, a search, and the frame with the arm raised."""

    def __init__(self, gaussians: Gaussians, degrees: float):
        self.rest = gaussians
        self.anchors = build_anchors(gaussians, target_count=40)

        def render(posed, camera):
            rendering = RENDERER.render(posed, camera)
            return rendering.rgb, rendering.alpha

        self.solver = ImageSolver(gaussians, self.anchors, render, SOLVER)
        sketcher = Sketcher(self.solver, self.anchors, RENDERER, ViewColors())
        self.search = LimbSearch(self.solver, self.anchors, render, sketcher, CONFIG)
        self.true = raised(gaussians, degrees)
        frames = filmed([draw(RENDERER, self.true, CAMERA)])
        window = Window(left=0, top=0, width=CAMERA.width_px, height=CAMERA.height_px)
        self.target = FrameView.read(frames, 0).target(window, CAMERA, RENDERER.device)
        self.still = AnchorPoses.identity(self.anchors)

    def error(self, poses: AnchorPoses) -> float:
        """Mean error of the arm, as a share of its motion."""
        off = (self.solver.pose(poses).means - self.true.means)[1500:].norm(dim=1).mean()
        return float(off / (self.rest.means - self.true.means)[1500:].norm(dim=1).mean())


def test_finds_an_arm_that_descent_has_lost(armed):
    lab = Lab(armed, 75.0)
    own = lab.solver.solve(lab.target, lab.still, lab.still)
    assert lab.error(own) > 0.8, "descent finds it by itself: nothing to search for"
    found = lab.search.after_large_step(lab.target, own, lab.still)
    assert found is not None
    assert lab.error(found) < 0.2


def test_keeps_what_is_right(armed):
    lab = Lab(armed, 12.0)
    own = lab.solver.solve(lab.target, lab.still, lab.still)
    assert lab.error(own) < 0.15
    found = lab.search.after_large_step(lab.target, own, lab.still)
    assert found is None or lab.error(found) < 0.15


@pytest.mark.parametrize(
    ("middle_px", "is_found"), [((80.0, 25.0), True), ((8.0, 80.0), False)], ids=["near", "far"]
)
def test_only_what_reaches_a_missing_piece_is_searched_for(armed, middle_px, is_found):
    lab = Lab(armed, 75.0)
    own = lab.solver.solve(lab.target, lab.still, lab.still)
    piece = Piece(share=0.1, middle_px=np.array(middle_px))
    found = lab.search.for_piece(lab.target, own, piece)
    assert (found is not None and lab.error(found) < 0.3) is is_found


def test_the_missing_piece_is_where_the_arm_should_be(armed):
    lab = Lab(armed, 75.0)
    piece = lab.search.missing_piece(lab.target, lab.still)
    arm_px = CAMERA.project(lab.true.means[1500:].numpy())[0]
    assert piece is not None
    assert np.linalg.norm(piece.middle_px - arm_px.mean(axis=0)) < 8.0
    assert lab.search.missing_piece(Lab(armed, 0.0).target, lab.still) is None


@pytest.mark.parametrize(
    ("energy", "last", "bad"),
    [(0.15, 0.1, False), (0.17, 0.1, True), (0.03, 0.001, False), (0.04, 0.001, True)],
)
def test_badly_explained_is_relative_to_the_last_frame_and_not_to_perfection(energy, last, bad):
    config = LimbSearchConfig(worse=1.6, usual=0.02)
    assert is_badly_explained(energy, last, config) is bad


@pytest.mark.parametrize(("place", "far"), [(0.02, False), (0.04, True)])
def test_far_is_a_large_step_of_the_fastest_anchors(place, far):
    def frame(shift: float) -> SolvedFrame:
        places = torch.zeros(50, 3)
        places[:5, 0] = shift
        poses = AnchorPoses(quats_wxyz=torch.eye(4)[:1].repeat(50, 1), translations=places)
        groups = RigidGroups(labels=np.full(1, -1, np.int64))
        return SolvedFrame(poses=poses, camera=CAMERA, groups=groups, stats=STATS)

    assert is_far(frame(0.0), frame(place), 1.0, LimbSearchConfig(far=0.03)) is far
