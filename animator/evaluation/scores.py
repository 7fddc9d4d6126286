"""All figures of one result on one scene."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import torch

from animator.evaluation.carried_points import CarriedPoints
from animator.evaluation.image_scores import ImageScores, Picture, mean_scores, score_picture
from animator.evaluation.motion import Motion
from animator.evaluation.motion_scores import MotionScores, PointTracks, score_motion
from animator.evaluation.perceptual import Judge
from animator.evaluation.truth_scene import TruthScene
from animator.render.protocol import Renderer
from animator.types import Camera, Gaussians

FRONT = "front"
"""Name of the clip's own view."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewScores:
    """One picture of one frame."""

    number: int
    """The frame."""
    view: str
    """`FRONT`, or the name of a held-out view."""
    scores: ImageScores


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scores:
    """What one method reached on one scene."""

    motion: MotionScores
    held_out: ImageScores
    """Mean over the held-out pictures of the scored frames."""
    front: ImageScores
    """Mean over the clip's own view."""
    views: tuple[ViewScores, ...]
    """Every picture by itself."""


def score_result(
    motion: Motion,
    tracks: PointTracks,
    scene: TruthScene,
    renderer: Renderer,
    judges: Mapping[str, Judge],
) -> Scores:
    """Score a result.

    Args:
        motion: What was found.
        tracks: The true points, riding on it.
        scene: The truth.
        renderer: Draws the result.
        judges: Perceptual measures, which are slow: for held-out views only.
    """
    views = tuple(_score_views(motion, tracks, scene, renderer, judges))
    return Scores(
        motion=score_motion(tracks),
        held_out=mean_scores([view.scores for view in views if view.view != FRONT]),
        front=mean_scores([view.scores for view in views if view.view == FRONT]),
        views=views,
    )


def carried_points(motion: Motion, scene: TruthScene) -> CarriedPoints:
    """Bind the true points to the Gaussians of a result."""
    truth = scene.truth
    if truth.gaussian_ids is not None:
        return CarriedPoints.on_centers(truth.gaussian_ids, motion.gaussians)
    return CarriedPoints.on_surface(truth.points[0], motion.gaussians, diagonal=truth.diagonal)


def point_tracks(
    motion: Motion, carried: CarriedPoints, scene: TruthScene, scored_numbers: Sequence[int]
) -> PointTracks:
    """Let the true points ride on the Gaussians that were found."""
    truth, rows = scene.truth, scene.rows(motion.numbers)
    return PointTracks(
        numbers=motion.numbers,
        is_scored=np.isin(motion.numbers, list(scored_numbers)),
        rest=truth.points[0],
        true=truth.points[rows],
        found=np.stack([carried.at(positions) for positions in motion.positions]),
        is_seen=truth.is_seen[rows],
        is_outer=truth.is_outer,
        part_ids=truth.part_ids,
        part_names=truth.part_names,
        has_rigid_parts=truth.has_rigid_parts,
        camera_positions=np.stack([scene.cameras[row].position for row in rows]),
        diagonal=truth.diagonal,
    )


def draw(gaussians: Gaussians, camera: Camera, renderer: Renderer) -> Picture:
    """Draw Gaussians on black; colors are clipped to 0..1."""
    with torch.no_grad():
        rendering = renderer.render(gaussians.to(renderer.device), camera)
    rgb = rendering.rgb.cpu().numpy().clip(0.0, 1.0)
    return Picture(rgb=rgb, alpha=rendering.alpha.cpu().numpy())


def _score_views(
    motion: Motion,
    tracks: PointTracks,
    scene: TruthScene,
    renderer: Renderer,
    judges: Mapping[str, Judge],
) -> Iterator[ViewScores]:
    for index, number in enumerate(motion.numbers):
        if not tracks.is_scored[index]:
            continue
        posed = motion.posed(index)
        drawn = draw(posed, scene.front_camera(number), renderer)
        scores = score_picture(drawn, scene.front_picture(number), {})
        yield ViewScores(number=number, view=FRONT, scores=scores)
        for view in scene.held_out:
            if view.number == number:
                drawn = draw(posed, view.camera, renderer)
                scores = score_picture(drawn, view.picture(), judges)
                yield ViewScores(number=number, view=view.name, scores=scores)
