"""What a result looks like beside the truth: from the clip's own view and from a held-out one."""

from collections.abc import Sequence

import numpy as np

from animator.evaluation.benchmark import Row
from animator.evaluation.image_scores import Picture
from animator.evaluation.scores import draw
from animator.evaluation.truth_scene import TruthScene
from animator.render.protocol import Renderer
from animator.report.contact_sheet import object_window, picture_grid
from animator.report.measurement import evenly_chosen
from animator.report.quality import SOLID_ALPHA
from animator.types import Camera

FRAME_COUNT = 4
_TITLES = ("truth", "result", "difference")


def comparison_sheet(row: Row, scene: TruthScene, renderer: Renderer) -> np.ndarray:
    """Lay out truth, result and difference of a few frames, front and one held-out view.

    Returns:
        sRGB, uint8, shape (H, W, 3).
    """
    held_out = _held_out_pictures(row, scene)
    numbers = [number for number in row.scored_numbers if number in held_out]
    if not numbers:
        numbers = list(row.scored_numbers)
    numbers = [numbers[k] for k in evenly_chosen(len(numbers), FRAME_COUNT)]
    columns = [_triples(row, _front_pictures(row, scene), numbers, renderer)]
    titles = [f"front: {title}" for title in _TITLES]
    if held_out:
        columns.append(_triples(row, held_out, numbers, renderer))
        titles += [f"held out: {title}" for title in _TITLES]
    rows = [[image for column in columns for image in column[k]] for k in range(len(numbers))]
    return picture_grid(titles, rows, [_caption(row, number) for number in numbers])


def _front_pictures(row: Row, scene: TruthScene) -> dict[int, tuple[Camera, Picture]]:
    return {
        number: (scene.front_camera(number), scene.front_picture(number))
        for number in row.scored_numbers
    }


def _held_out_pictures(row: Row, scene: TruthScene) -> dict[int, tuple[Camera, Picture]]:
    """Return the pictures of the held-out view that differs most from the clip's own, by frame."""
    wanted = [view for view in scene.held_out if view.number in row.scored_numbers]
    if not wanted:
        return {}
    axis = scene.front_camera(wanted[0].number).cam_from_world[2, :3]
    chosen = min(wanted, key=lambda view: abs(float(view.camera.cam_from_world[2, :3] @ axis)))
    return {
        view.number: (view.camera, view.picture()) for view in wanted if view.name == chosen.name
    }


def _triples(
    row: Row,
    pictures: dict[int, tuple[Camera, Picture]],
    numbers: Sequence[int],
    renderer: Renderer,
) -> list[list[np.ndarray]]:
    """Return truth, result and difference of each frame, cut to one window; black without truth."""
    shown = []
    for number in numbers:
        if number not in pictures:
            continue
        camera, true = pictures[number]
        posed = row.motion.posed(row.motion.numbers.index(number))
        shown.append((true, draw(posed, camera, renderer)))
    masks = [picture.alpha > SOLID_ALPHA for pair in shown for picture in pair]
    window = object_window(masks)
    return [
        [_bytes(image[window]) for image in (true.rgb, drawn.rgb, np.abs(true.rgb - drawn.rgb))]
        for true, drawn in shown
    ]


def _caption(row: Row, number: int) -> str:
    errors = next(frame.all for frame in row.scores.motion.frames if frame.number == number)
    return (
        f"{row.scene}, {row.method}, frame {number}   error {errors.epe_percent:.2f} % of the "
        f"diagonal: lateral {errors.lateral_percent:.2f} %, depth {errors.depth_percent:.2f} %"
    )


def _bytes(rgb: np.ndarray) -> np.ndarray:
    return np.rint(rgb * 255.0).astype(np.uint8)
