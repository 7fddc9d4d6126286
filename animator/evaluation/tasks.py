"""What is asked of a method: the whole clip, two frames, in-betweens, a worse model, more to go by."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch

from animator.errors import InputError
from animator.evaluation.truth_scene import TruthScene
from animator.scene import Scene, read_depth_maps, read_ply
from animator.types import Gaussians

HALF_MODEL = "init_half.ply"
"""The model trained from half of the views, where a scene provides it."""
DEPTH_FOLDER = "depth"
"""One depth map a frame, where a scene provides them."""
NOISE_COUNT = 1000
"""Gaussians added by the task `noise`, as many as in the paper."""


class NotProvidedError(InputError):
    """A scene lacks what a task needs; the others may have it."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Task:
    """One question."""

    summary: str
    stride: int = 1
    """Every how many frames one is given; those between are asked for."""
    first_and_last_only: bool = False
    noise: int = 0
    """Gaussians of noise added to the model."""
    needs_half_model: bool = False
    needs_depth_maps: bool = False

    @property
    def is_interpolation(self) -> bool:
        """Whether frames are asked for that are not given."""
        return self.stride > 1


TASKS: dict[str, Task] = {
    "clip": Task(summary="all frames, one after the other"),
    "single": Task(
        summary="from rest to the last frame alone, the paper's task", first_and_last_only=True
    ),
    "interpolate2": Task(summary="every second frame given, scored on the others", stride=2),
    "interpolate4": Task(summary="every fourth frame given, scored on the others", stride=4),
    "noise": Task(
        summary=f"the clip with {NOISE_COUNT:,} Gaussians of noise in the model", noise=NOISE_COUNT
    ),
    "half-views": Task(
        summary="the clip with the model trained from half of the views", needs_half_model=True
    ),
    "depth": Task(summary="the clip with a depth map of each frame", needs_depth_maps=True),
}


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Assignment:
    """A task on one scene."""

    scene: Scene
    """What the method is given."""
    numbers: tuple[int, ...]
    """Frames from the first to the last given one: those given, and those asked for."""
    scored_numbers: tuple[int, ...]
    """Frames that count."""
    model_size: int
    """Gaussians of the model, before the noise."""
    inbetween: int
    """Frames wanted between two given ones."""


def assign(
    task: Task, truth: TruthScene, *, frames: Sequence[int] | None = None, seed: int = 0
) -> Assignment:
    """Pose a task on a scene.

    Args:
        task: The task.
        truth: The scene.
        frames: Only these frames, in increasing order, the first among them; None for all.
        seed: Of the noise.

    Raises:
        NotProvidedError: If the scene lacks what the task needs.
        InputError: If it has no such frames, or too few.
    """
    numbers = _frames_of(truth, frames)
    if task.first_and_last_only:
        numbers = (numbers[0], numbers[-1])
    given = numbers[:: task.stride]
    if len(given) < 2:
        raise InputError(
            f"{truth.folder}: expected at least two frames to animate, found {len(given)}."
        )
    scored = given[1:]
    if task.is_interpolation:
        numbers = numbers[: numbers.index(given[-1]) + 1]
        scored = tuple(number for number in numbers if number not in given)
    rows = [int(row) for row in truth.rows(given)]
    gaussians = _half_model(truth) if task.needs_half_model else truth.scene.gaussians
    model_size = len(gaussians)
    if task.noise:
        gaussians = with_noise(gaussians, task.noise, np.random.default_rng(seed))
    frames_given = truth.scene.frames
    if task.needs_depth_maps:
        frames_given = dataclasses.replace(frames_given, depths=_depth_maps(truth))
    cameras = truth.scene.frame_cameras
    if cameras is not None and len(cameras) > 1:
        cameras = tuple(cameras[row] for row in rows)
    scene = dataclasses.replace(
        truth.scene,
        gaussians=gaussians,
        frames=frames_given.take(rows),
        frame_cameras=cameras,
    )
    return Assignment(
        scene=scene,
        numbers=numbers,
        scored_numbers=scored,
        model_size=model_size,
        inbetween=task.stride - 1,
    )


def with_noise(gaussians: Gaussians, count: int, rng: np.random.Generator) -> Gaussians:
    """Add Gaussians that belong to nothing, as a poor reconstruction has them: after the others.

    They lie anywhere in the object's box, have sizes and opacities of Gaussians of the model drawn
    at random, and any rotation and color.
    """
    means = gaussians.means.cpu().numpy()
    low, high = np.percentile(means, [0.5, 99.5], axis=0)
    models = torch.from_numpy(rng.integers(0, len(gaussians), count))
    quats = rng.normal(size=(count, 4))
    sh_coeffs = torch.zeros(count, *gaussians.sh_coeffs.shape[1:])
    sh_0 = 0.28209479177387814  # Y_0^0 = 1 / (2 sqrt(pi))
    sh_coeffs[:, 0] = torch.from_numpy((rng.random((count, 3)) - 0.5) / sh_0)
    noise = Gaussians(
        means=torch.from_numpy(rng.uniform(low, high, (count, 3))).float(),
        quats_wxyz=torch.from_numpy(quats / np.linalg.norm(quats, axis=1, keepdims=True)).float(),
        scales=gaussians.scales[models],
        opacities=gaussians.opacities[models],
        sh_coeffs=sh_coeffs,
    )
    fields = dataclasses.fields(Gaussians)
    both = {f.name: torch.cat([getattr(gaussians, f.name), getattr(noise, f.name)]) for f in fields}
    return Gaussians(**both)


def _frames_of(truth: TruthScene, frames: Sequence[int] | None) -> tuple[int, ...]:
    if frames is None:
        return truth.numbers
    missing = [number for number in frames if number not in truth.numbers]
    if missing:
        raise InputError(
            f"{truth.folder}: --frames: there is no frame {missing[0]}; the clip has frames "
            f"{truth.numbers[0]} to {truth.numbers[-1]}."
        )
    chosen = tuple(number for number in truth.numbers if number in frames)
    if chosen[0] != truth.numbers[0]:
        raise InputError(
            f"--frames: expected the first frame, {truth.numbers[0]}, among them: the model is at "
            "rest there, and motion is counted from it."
        )
    return chosen


def _half_model(truth: TruthScene) -> Gaussians:
    path = truth.folder / HALF_MODEL
    if not path.is_file():
        raise NotProvidedError(
            f"{truth.folder}: no {HALF_MODEL}, so the task half-views is left out for this scene."
        )
    if truth.truth.gaussian_ids is not None:
        raise NotProvidedError(
            f"{truth.folder}: its truth is that of the Gaussians of its own model, so the task "
            "half-views is left out for this scene."
        )
    return read_ply(path)


def _depth_maps(truth: TruthScene) -> np.ndarray:
    folder = truth.folder / DEPTH_FOLDER
    if not folder.is_dir():
        raise NotProvidedError(
            f"{truth.folder}: no folder {DEPTH_FOLDER}/, so the task depth is left out for this scene."
        )
    return read_depth_maps(truth.scene.frames, folder)
