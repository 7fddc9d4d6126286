import dataclasses

import numpy as np
import pytest
import torch

from animator.commands import evaluate_arguments
from animator.errors import InputError
from animator.evaluation.methods import METHOD_SETS, METHODS, chosen_methods
from animator.evaluation.rgb_only import RgbOnlyConfig, fit_rgb_only
from animator.evaluation.scores import draw
from animator.evaluation.tasks import TASKS, NotProvidedError, assign, with_noise
from animator.evaluation.truth_scene import TruthScene, read_truth_scene
from animator.pipeline import FitConfig


@pytest.fixture(scope="module")
def truth(master_scene, renderer) -> TruthScene:
    return read_truth_scene(master_scene, renderer)


@pytest.mark.parametrize(
    ("task", "given", "numbers", "scored"),
    [
        ("clip", (0, 1, 2, 3), (0, 1, 2, 3), (1, 2, 3)),
        ("single", (0, 3), (0, 3), (3,)),
        ("interpolate2", (0, 2), (0, 1, 2), (1,)),
    ],
)
def test_which_frames_are_given_and_which_count(truth, task, given, numbers, scored):
    assignment = assign(TASKS[task], truth)
    assert assignment.scene.frames.numbers == given
    assert assignment.numbers == numbers
    assert assignment.scored_numbers == scored


def test_chosen_frames_begin_at_rest(truth):
    assert assign(TASKS["clip"], truth, frames=(2, 0)).scene.frames.numbers == (0, 2)
    with pytest.raises(InputError, match="first frame"):
        assign(TASKS["clip"], truth, frames=(1, 2))
    with pytest.raises(InputError, match="no frame 9"):
        assign(TASKS["clip"], truth, frames=(0, 9))
    with pytest.raises(InputError, match="two frames"):
        assign(TASKS["interpolate4"], truth)


def test_noise_comes_after_the_model_and_is_the_same_for_the_same_seed(truth):
    gaussians = truth.scene.gaussians
    first, again, other = (
        with_noise(gaussians, 50, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    count = len(gaussians)
    assert len(first) == count + 50
    for field in dataclasses.fields(first):
        values = getattr(first, field.name)
        assert torch.equal(values[:count], getattr(gaussians, field.name))
        assert torch.equal(values, getattr(again, field.name))
    assert not torch.equal(first.means, other.means)
    assert first.quats_wxyz.norm(dim=1).sub(1).abs().max() < 1e-6
    assert (first.means[count:].abs() < torch.tensor([0.71, 0.41, 0.31])).all()
    assignment = assign(TASKS["noise"], truth)
    assert assignment.model_size == count
    assert len(assignment.scene.gaussians) == count + 1000


def test_half_of_the_views_must_be_provided(truth):
    with pytest.raises(NotProvidedError, match=r"init_half\.ply"):
        assign(TASKS["half-views"], truth)


def test_depth_maps_are_given_with_the_frames(truth, tmp_path):
    with pytest.raises(NotProvidedError, match="depth/"):
        assign(TASKS["depth"], dataclasses.replace(truth, folder=tmp_path))
    (tmp_path / "depth").mkdir()
    shape = truth.scene.frames.alphas.shape[1:]
    for number in truth.numbers:
        np.save(tmp_path / "depth" / f"{number}.npy", np.full(shape, 1.0 + number, np.float32))
    provided = dataclasses.replace(truth, folder=tmp_path)
    given = assign(TASKS["depth"], provided, frames=(0, 2)).scene.frames.depths
    assert given is not None
    np.testing.assert_array_equal(given[:, 0, 0], [1.0, 3.0])
    assert assign(TASKS["clip"], provided).scene.frames.depths is None


def test_the_command_offers_what_there_is():
    assert tuple(TASKS) == evaluate_arguments.TASK_NAMES
    assert chosen_methods(evaluate_arguments.DEFAULT_METHODS) == ("static", "full")
    assert set(METHOD_SETS["all"]) == set(METHODS)
    assert chosen_methods("ablation,static") == ("static", *METHOD_SETS["ablation"])
    with pytest.raises(InputError, match="nerf"):
        chosen_methods("full,nerf")
    with pytest.raises(InputError, match="at least one"):
        chosen_methods(" , ")


def test_the_scgs_like_baseline_has_rgb_and_arap_only():
    config = METHODS["rgb-arap"].adjust(FitConfig(seed=5))
    solver = config.driver.image_solver
    on = {name for name, weight in vars(solver.weights).items() if weight}
    assert on == {"rgb", "arap"}
    assert solver.smoothing == 0
    assert solver.coarse.nodes == ()
    assert config.steadying.rigid_body.residual == 0
    assert config.steadying.smoothing.strength == 0
    assert config.second_look.every == 0
    assert config.loosening.every == 0
    assert not config.driver.continue_motion
    assert config.driver.limb_search.most_swings == 0
    assert config.seed == 5


def test_free_gaussians_follow_the_picture(truth, renderer):
    assignment = assign(TASKS["clip"], truth, frames=(0, 1))
    cameras = truth.cameras[:2]
    config = RgbOnlyConfig(iterations=20, shift_rate=3e-3)
    motion = fit_rgb_only(assignment.scene, cameras, renderer, config)
    assert motion.numbers == (0, 1)
    np.testing.assert_array_equal(motion.positions[0], truth.scene.gaussians.means.numpy())
    true = truth.front_picture(1).rgb
    before, after = (
        np.abs(draw(motion.posed(k), cameras[1], renderer).rgb - true).mean() for k in (0, 1)
    )
    assert after < 0.6 * before
