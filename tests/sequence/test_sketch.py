import pytest
import torch

from animator.deform.anchors import build_anchors
from animator.deform.image_solver import ImageSolver, ImageSolverConfig
from animator.render.cpu import CpuRenderer
from animator.sequence.sketch import Sketch, Sketcher
from animator.sequence.target import FrameView, Window
from animator.sequence.view_colors import ViewColors
from animator.types import AnchorPoses, Gaussians
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(4.5, size_px=96)
RENDERER = CpuRenderer()


def sketch_of(box: Gaussians, shown: Gaussians) -> tuple[Sketch, AnchorPoses]:
    """A sketch of what is shown, with a third of the Gaussians, and the pose at rest."""

    def render(gaussians, camera):
        rendering = RENDERER.render(gaussians, camera)
        return rendering.rgb, rendering.alpha

    anchors = build_anchors(box, target_count=30)
    solver = ImageSolver(box, anchors, render, ImageSolverConfig())
    frames = filmed([draw(RENDERER, shown, CAMERA)])
    window = Window(left=0, top=0, width=CAMERA.width_px, height=CAMERA.height_px)
    target = FrameView.read(frames, 0).target(window, CAMERA, RENDERER.device)
    sketcher = Sketcher(solver, anchors, RENDERER, ViewColors(), most_gaussians=500)
    return sketcher.sketch(target), AnchorPoses.identity(anchors)


@pytest.fixture(scope="module")
def box() -> Gaussians:
    return textured_box(1500)


def test_a_sketch_tells_where_the_object_is_and_which_way_to_go(box):
    shift = torch.tensor([0.1, 0.0, 0.0])
    sketch, still = sketch_of(box, box.posed(box.means + shift, box.quats_wxyz))
    true = AnchorPoses(quats_wxyz=still.quats_wxyz, translations=still.translations + shift)
    assert sketch.energy(true) < 0.8 * sketch.energy(still)
    found = sketch.solve(still, 40)
    assert sketch.energy(found) < 0.4 * sketch.energy(still)
    # Depth is not for a sketch to tell: it makes up there for how other it looks with fewer Gaussians.
    across = found.translations.mean(dim=0)[:2] - shift[:2]
    assert float(across.norm()) < 0.3 * float(shift.norm())
