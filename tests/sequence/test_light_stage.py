"""The light of a clip, learned from a box that turned under it."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.deform.pace import PaceConfig
from animator.match.flow import FlowMatcher
from animator.render.cpu import CpuRenderer
from animator.render.spherical_harmonics import SH_C0
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.driver import Driver, DriverConfig
from animator.sequence.light_stage import LightStageConfig
from animator.sequence.loosening import LooseningConfig, loosened
from animator.sequence.solved_frame import SolvedFrame
from animator.types import Gaussians
from tests.helpers.moved_box import rigid
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(3.0, size_px=200)
RENDERER = CpuRenderer()
LIGHT = np.array([0.25, 0.0, -0.15])
TURN = Rotation.from_euler("y", 40, degrees=True)


@pytest.fixture(scope="module")
def box() -> Gaussians:
    box = textured_box(4000)
    # Rather gray than black or colored: of that a ratio says more.
    return dataclasses.replace(box, sh_coeffs=0.2 * box.sh_coeffs, scales=0.6 * box.scales)


def lit(box: Gaussians) -> Gaussians:
    """The box, turned, as bright as the light makes it there."""
    points = box.means.numpy()
    faces = np.abs(points / [0.7, 0.4, 0.3]).argmax(axis=1)
    normals = np.eye(3)[faces] * np.sign(points)
    gains = np.exp((TURN.apply(normals) - normals) @ LIGHT)
    colors = (box.sh_coeffs[:, 0] * SH_C0 + 0.5) * torch.as_tensor(gains, dtype=torch.float32)[
        :, None
    ]
    turned = box.posed(
        torch.as_tensor(TURN.apply(points), dtype=torch.float32),
        torch.as_tensor(
            np.tile(TURN.as_quat(scalar_first=True), (len(box), 1)), dtype=torch.float32
        ),
    )
    return dataclasses.replace(turned, sh_coeffs=((colors - 0.5) / SH_C0)[:, None])


def solved(box: Gaussians, config: LightStageConfig) -> tuple[Driver, list[SolvedFrame]]:
    """A driver of two frames, the second lit, and their true poses."""
    anchors = build_anchors(box, target_count=30)
    problem = ClipProblem(
        gaussians=box,
        anchors=anchors,
        frames=filmed([draw(RENDERER, shown, CAMERA) for shown in (box, lit(box))]),
        cameras=(CAMERA,) * 2,
        renderer=RENDERER,
        matcher=FlowMatcher(),
        seed=0,
    )
    driver = Driver(problem, DriverConfig(use_matches=False, light=config))
    first = driver.first()
    stats = dataclasses.replace(first.stats, start="previous")
    turned = dataclasses.replace(first, poses=rigid(anchors, TURN, [0.0, 0.0, 0.0]), stats=stats)
    return driver, [first, turned]


def test_the_light_is_found_and_explains_the_frame(box):
    # Few Gaussians of two faces: one frame like this would not convince it.
    driver, frames = solved(box, LightStageConfig(alike=1.0))
    without = driver.image_loss(1, frames[1])
    driver.light_stage.learn_afresh(frames)
    light = driver._sight.shading.light.numpy()
    # What turns about the vertical axis does not show how much light comes from above.
    np.testing.assert_allclose(light, LIGHT, atol=0.1)
    assert driver.image_loss(1, frames[1]) < 0.5 * without


def test_what_is_drawn_in_the_light_already_does_not_unlearn_it(box):
    driver, frames = solved(box, LightStageConfig(alike=1.0))
    driver.light_stage.learn_afresh(frames)
    once = driver._sight.shading.light.clone()
    for _ in range(4):
        driver.light_stage.learn(1, frames[1])
    torch.testing.assert_close(driver._sight.shading.light, once, rtol=0.0, atol=0.03)


def test_it_is_learned_on_the_way_and_again_before_the_last_solve(box):
    driver, frames = solved(box, LightStageConfig())
    list(driver.run(frames[:1]))
    assert driver._sight.shading.light.any()
    driver.light_stage.learn_afresh(())
    assert not driver._sight.shading.light.any()
    loosened(frames, driver, LooseningConfig(pace=PaceConfig(most_steps=2)))
    assert driver._sight.shading.light.any()


def test_learning_again_forgets_what_was_learned(box):
    driver, frames = solved(box, LightStageConfig())
    driver.light_stage.learn_afresh(frames)
    once = driver._sight.shading.light.clone()
    driver.light_stage.learn_afresh(frames)
    torch.testing.assert_close(driver._sight.shading.light, once)
    driver.light_stage.learn_afresh(frames[:1])
    assert not driver._sight.shading.light.any()


def test_a_held_frame_says_nothing(box):
    driver, frames = solved(box, LightStageConfig())
    held = dataclasses.replace(frames[1], stats=dataclasses.replace(frames[1].stats, start="held"))
    driver.light_stage.learn_afresh([frames[0], held])
    assert not driver._sight.shading.light.any()


def test_it_can_be_switched_off(box):
    driver, frames = solved(box, LightStageConfig(spread=0.0))
    driver.light_stage.learn_afresh(frames)
    assert not driver._sight.shading.light.any()
