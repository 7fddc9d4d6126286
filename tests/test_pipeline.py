"""What the stages hand to each other."""

import numpy as np
import pytest
import torch

from animator import pipeline
from animator.deform.anchors import build_anchors, with_sharper_skin
from animator.pipeline import FitConfig, fit
from animator.render.cpu import CpuRenderer
from animator.rig.bake import ClipLabels
from animator.scene import Scene
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(3.0, size_px=64)


@pytest.mark.parametrize("is_smooth", [False, True])
def test_a_smooth_motion_is_baked_with_the_finer_rig_it_was_solved_with(monkeypatch, is_smooth):
    box = textured_box(800)
    frame = draw(CpuRenderer(), box, CAMERA)
    scene = Scene(
        gaussians=box,
        capture_cameras=(),
        frames=filmed([frame, frame]),
        frame_cameras=(CAMERA,) * 2,
        notes=(),
    )
    rigs = []

    def solved_smoothly(solved, driver, config, loosening):
        rigs.append(driver.problem.anchors)
        return solved

    monkeypatch.setattr(pipeline, "moves_smoothly", lambda *_: is_smooth)
    monkeypatch.setattr(pipeline, "solved_smoothly", solved_smoothly)
    done = fit(
        scene, ClipLabels(name="box", fps=24.0), FitConfig(device="cpu", anchors=30, matcher="flow")
    )
    coarse, fine = (build_anchors(box, target_count=count) for count in (30, 60))
    if is_smooth:
        assert rigs == [done.anchors] * FitConfig().smooth_motion.rounds
        fine = with_sharper_skin(fine, FitConfig().smooth_motion.sharpness)
        torch.testing.assert_close(done.anchors.positions, fine.positions)
        torch.testing.assert_close(done.anchors.skin_weights, fine.skin_weights)
    else:
        assert rigs == []
        torch.testing.assert_close(done.anchors.positions, coarse.positions)
        torch.testing.assert_close(done.anchors.skin_weights, coarse.skin_weights)
    assert len(done.clip.rig.joint_names) == len(done.anchors) + 1
    assert all(len(frame.poses.translations) == len(done.anchors) for frame in done.solved)
    largest = np.sort(done.clip.skin.weights, axis=1)[:, -1]
    np.testing.assert_allclose(largest, done.anchors.skin_weights.max(dim=1).values, atol=1e-5)
