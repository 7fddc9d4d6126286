"""What no clip may do, on the example: move without cause, bend what is stiff, not come back."""

import dataclasses
import importlib.util
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from animator.pipeline import FitConfig, fit
from animator.render.cpu import CpuRenderer
from animator.rig.bake import ClipLabels
from animator.scene import FrameOptions, Scene, discover, read_scene
from animator.types import Frames
from exporters.clip import Clip

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.fixture(scope="module")
def lamp() -> Scene:
    return read_scene(discover(EXAMPLES / "desk_lamp" / "frames"), FrameOptions())


@pytest.fixture
def maker(monkeypatch):
    """The script that made the example; it can photograph the lamp anywhere."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    spec = importlib.util.spec_from_file_location("make_lamp", EXAMPLES / "make_desk_lamp.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def fitted(scene: Scene, frames: Frames) -> Clip:
    count = len(frames)
    renumbered = dataclasses.replace(frames, numbers=tuple(range(count)))
    scene = dataclasses.replace(scene, frames=renumbered)
    return fit(scene, ClipLabels(name="lamp", fps=24.0), FitConfig(device="cpu", anchors=120)).clip


def positions(clip: Clip) -> np.ndarray:
    """The Gaussians at every key, shape (T, N, 3)."""
    return np.stack([clip.pose_at(time_s).positions for time_s in clip.tracks.times_s])


def largest_shift(before: np.ndarray, after: np.ndarray) -> float:
    return float(np.linalg.norm(after.astype(np.float64) - before, axis=-1).max())


def mean_shift(before: np.ndarray, after: np.ndarray) -> float:
    return float(np.linalg.norm(after.astype(np.float64) - before, axis=-1).mean())


def rigid_rms(before: np.ndarray, after: np.ndarray) -> float:
    """RMS distance from the best rigid motion."""
    source, target = (points - points.mean(axis=0) for points in (before, after))
    turn, _ = Rotation.align_vectors(target, source)
    return float(np.sqrt(np.square(turn.apply(source) - target).sum(axis=1).mean()))


def test_a_static_clip_stays_at_rest(lamp):
    """Frame 0 again and again, with the noise of a sensor: less than 0.1 % of the diagonal."""
    frames = lamp.frames.take([0] * 12)
    noise = np.random.default_rng(0).normal(0.0, 2.0, frames.images.shape)
    noisy = (frames.images + noise).round().clip(0, 255).astype(np.uint8)
    clip = fitted(lamp, dataclasses.replace(frames, images=noisy))
    drift = largest_shift(lamp.gaussians.means.numpy(), positions(clip))
    assert drift < 1e-3 * lamp.gaussians.diagonal


@pytest.mark.slow
def test_a_rigid_motion_comes_out_rigid(lamp, maker):
    """The lamp turns by 9 degrees and moves, its joints locked, under a light that does not turn."""
    frames = photographed(maker, lamp.frames, [rigid_motion(step) for step in range(4)])
    found = positions(fitted(lamp, frames))
    diagonal = lamp.gaussians.diagonal
    assert mean_shift(found[0], found[-1]) > 0.02 * diagonal  # of 3 % that it moves
    for later in found[1:]:
        assert rigid_rms(found[0], later) < 1e-3 * diagonal


@pytest.mark.slow
def test_forward_and_back_again_ends_near_the_start(lamp):
    """Frames 0, 3, 6, 3, 0: the last shows rest again, and no frame is seen twice in a row.

    A pose that is solved is uncertain by what the splat lets it move without being drawn worse: a
    lamp that stands still is moved by 0.14 % of the diagonal. Two such poses differ by less than
    0.3 %; anything that got stuck or lost on the way, of a motion of 7 %, is more. Measured: 0.12 %.
    """
    found = positions(fitted(lamp, lamp.frames.take([0, 3, 6, 3, 0])))
    diagonal = lamp.gaussians.diagonal
    assert mean_shift(found[0], found[2]) > 0.02 * diagonal
    assert mean_shift(found[0], found[-1]) < 3e-3 * diagonal
    assert mean_shift(found[1], found[-2]) < 3e-3 * diagonal


def rigid_motion(step: int) -> np.ndarray:
    """Three degrees a step about an inclined axis through the lamp's middle, and a shift."""
    middle = np.array([0.1, 0.5, 0.0])
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(
        np.radians(3.0 * step) * np.array([0.3, 0.85, 0.43])
    ).as_matrix()
    motion[:3, 3] = middle - motion[:3, :3] @ middle + step * np.array([0.008, 0.004, 0.006])
    return motion


def photographed(maker, like: Frames, motions: Sequence[np.ndarray]) -> Frames:
    """Film the lamp of frame 0, moved as a whole."""
    from toybox.pictures import photograph

    rest = maker.true_transforms()[0]
    subject = maker.lamp_splats(maker.PICTURE_GAUSSIAN_COUNT, seed=1)
    renderer = CpuRenderer()
    pictures = np.stack(
        [photograph(subject.posed(motion @ rest), maker.CLIP_SHOT, renderer) for motion in motions]
    )
    return dataclasses.replace(
        like,
        images=pictures[..., :3],
        alphas=pictures[..., 3],
        names=tuple(f"{index}.png" for index in range(len(motions))),
    )
