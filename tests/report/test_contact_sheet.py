import dataclasses

import cv2
import numpy as np
import pytest
import torch

from animator.report.contact_sheet import CELL_PX, contact_sheet, png_bytes
from animator.report.measurement import FramePictures, evenly_chosen, measure
from animator.report.palette import UNGROUPED, group_colors


def pictures_of(object_box: tuple[slice, slice], size: tuple[int, int]) -> FramePictures:
    is_object = np.zeros(size, bool)
    is_object[object_box] = True
    paint = [np.zeros((*size, 3), np.uint8) for _ in range(4)]
    for image, color in zip(
        paint, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (250, 250, 0)], strict=True
    ):
        image[is_object] = color
    frame, render, difference, groups = paint
    return FramePictures(
        number=0,
        frame=frame,
        render=render,
        difference=difference,
        groups=groups,
        is_object=is_object,
    )


def test_columns_show_frame_render_difference_and_groups_in_that_order():
    pictures = pictures_of((slice(40, 60), slice(100, 140)), (120, 200))
    sheet = contact_sheet([pictures, pictures], ["one", "two"])
    middle = sheet[:, :, :].astype(int)
    centers = []
    for color in [(255, 0, 0), (0, 255, 0), (0, 0, 255), (250, 250, 0)]:
        matches = np.abs(middle - color).max(axis=-1) < 8
        assert matches.sum() > 2 * 0.5 * (CELL_PX * 0.8) * (CELL_PX * 0.4)
        centers.append(np.nonzero(matches)[1].mean())
    assert centers == sorted(centers)


def test_the_sheet_is_as_large_as_its_cells():
    pictures = pictures_of((slice(0, 100), slice(0, 100)), (100, 100))
    one = contact_sheet([pictures], ["a"])
    three = contact_sheet([pictures] * 3, ["a"] * 3)
    assert one.shape[1] == three.shape[1]
    assert 4 * CELL_PX < one.shape[1] < 4.2 * CELL_PX
    assert 3 * CELL_PX < three.shape[0] < 3.5 * CELL_PX
    row_px = (three.shape[0] - one.shape[0]) / 2
    assert CELL_PX < row_px < 1.2 * CELL_PX


@pytest.mark.parametrize(
    "box", [(slice(5, 6), slice(0, 300)), (slice(0, 300), slice(7, 8)), (slice(0, 0), slice(0, 0))]
)
def test_thin_and_empty_objects_fit(box):
    sheet = contact_sheet([pictures_of(box, (300, 300))], ["thin"])
    assert min(sheet.shape[:2]) > 20
    assert max(sheet.shape[:2]) < 3000


def test_captions_are_written():
    pictures = pictures_of((slice(0, 10), slice(0, 10)), (10, 10))
    difference = contact_sheet([pictures], ["frame 12"]) != contact_sheet([pictures], [""])
    assert difference.any()


def test_png_round_trip_keeps_red_red():
    image = np.zeros((3, 5, 3), np.uint8)
    image[1, 2] = (255, 10, 0)
    decoded = cv2.imdecode(np.frombuffer(png_bytes(image), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(decoded[..., ::-1], image)


@pytest.mark.parametrize(
    ("total", "count", "chosen"),
    [(1, 8, (0,)), (3, 8, (0, 1, 2)), (9, 3, (0, 4, 8)), (0, 8, ()), (100, 2, (0, 99))],
)
def test_pictures_are_chosen_evenly(total, count, chosen):
    assert evenly_chosen(total, count) == chosen


def test_groups_have_colors_of_their_own():
    labels = np.array([-1, *range(10)])
    colors = group_colors(labels)
    assert np.array_equal(colors[0], UNGROUPED)
    distances = np.linalg.norm(colors[:, None] - colors[None], axis=-1)
    np.fill_diagonal(distances, 1)
    assert distances.min() > 0.1
    assert group_colors(np.arange(100)).min() >= 0


@dataclasses.dataclass(frozen=True)
class _Fit:
    clip: object
    gaussians: object
    anchors: object
    solved: tuple
    renderer: object


@pytest.fixture
def fit_and_frames():
    """Two opaque blobs side by side, one a rigid group; the second frame is shifted to the right."""
    from animator.deform.anchors import build_anchors
    from animator.render.cpu import CpuRenderer
    from animator.rig.bake import ClipLabels, Key, bake_clip
    from animator.sequence.solved_frame import FrameStats, SolvedFrame
    from animator.types import AnchorPoses, Frames, RigidGroups
    from tests.helpers.objects import box_points, front_camera, gaussians_at

    left = box_points((-0.5, 0, 0), (0.3, 0.6, 0.3), 60, seed=1)
    right = box_points((0.5, 0, 0), (0.3, 0.6, 0.3), 60, seed=2)
    hidden = box_points((-0.5, 0, 3), (0.1, 0.1, 0.1), 30, seed=3)
    gaussians = gaussians_at(np.concatenate([left, right, hidden]), opacity=0.98, scale=0.08)
    anchors = build_anchors(gaussians, target_count=8)
    camera = front_camera(3.0, size_px=64)
    renderer = CpuRenderer()
    labels = np.repeat([0, -1, -1], [60, 60, 30])
    rest = AnchorPoses.identity(anchors)
    shift = torch.tensor([0.2, 0.0, 0.0])
    poses = [rest, dataclasses.replace(rest, translations=rest.translations + shift)]
    stats = FrameStats(matches=0, reprojection_px=1.0, start="", groups=1, seconds={})
    solved = tuple(
        SolvedFrame(poses=pose, camera=camera, groups=RigidGroups(labels=labels), stats=stats)
        for pose in poses
    )
    keys = [
        Key(time_s=index / 24, source_frame=index, poses=pose, camera=camera)
        for index, pose in enumerate(poses)
    ]
    nowhere = RigidGroups(labels=np.full(len(anchors), -1))
    clip = bake_clip(gaussians, anchors, nowhere, keys, ClipLabels(name="two", fps=24.0))
    # Both frames show the rest pose: the second solved pose is wrong by the shift.
    drawn = renderer.render(gaussians, camera)
    alpha = drawn.alpha.numpy()
    straight = drawn.rgb.numpy() / np.maximum(alpha, 1e-6)[..., None]
    frames = Frames(
        images=np.rint(np.stack([straight] * 2).clip(0, 1) * 255).astype(np.uint8),
        alphas=np.rint(np.stack([alpha] * 2) * 255).astype(np.uint8),
        numbers=(0, 1),
        names=("a", "b"),
        fps=24.0,
    )
    fit = _Fit(clip=clip, gaussians=gaussians, anchors=anchors, solved=solved, renderer=renderer)
    return fit, frames


def test_measurement_of_a_right_and_a_wrong_frame(fit_and_frames):
    fit, frames = fit_and_frames
    right, wrong = (measurement.quality for measurement in measure(fit, frames))
    assert right.psnr_db > 40
    assert right.silhouette_iou > 0.99
    assert wrong.psnr_db < 20
    assert wrong.silhouette_iou < 0.8
    # A shift is a rigid motion, and a skin of shifts is exact to rounding.
    assert wrong.rigid_residual_percent < 1e-4
    assert wrong.skin_error_percent < 1e-4
    # The thirty Gaussians behind the left blob are 20 % of the opacity, and more lie inside it.
    assert right.unseen_share > 0.2
    assert wrong.never_seen_share <= min(right.unseen_share, wrong.unseen_share)


def test_a_wrong_clip_shows_in_the_skin_error(fit_and_frames):
    fit, frames = fit_and_frames
    tracks = fit.clip.tracks
    moved = np.array(tracks.translations)
    moved[1, 1:, 1] += 0.1
    clip = dataclasses.replace(fit.clip, tracks=dataclasses.replace(tracks, translations=moved))
    _, wrong = (
        measurement.quality for measurement in measure(dataclasses.replace(fit, clip=clip), frames)
    )
    expected = 100 * 0.1 / fit.gaussians.diagonal
    assert wrong.skin_error_percent == pytest.approx(expected, rel=1e-4)


def test_pictures_show_the_group_in_its_color_and_the_rest_in_gray(fit_and_frames):
    fit, frames = fit_and_frames
    (first, second) = (measurement.pictures for measurement in measure(fit, frames))
    middle_row = first.groups[32].astype(float) / 255
    color = group_colors(np.array([0]))[0]
    left_blob, right_blob = middle_row[18], middle_row[46]
    np.testing.assert_allclose(left_blob / left_blob.sum(), color / color.sum(), atol=0.02)
    np.testing.assert_allclose(right_blob / right_blob.sum(), [1 / 3] * 3, atol=0.02)
    assert first.difference.max() < 6
    assert second.difference.max() > 60
    assert first.is_object[32, 18]
    assert not first.is_object[2, 2]


def test_only_the_chosen_frames_have_pictures(fit_and_frames):
    fit, frames = fit_and_frames
    measurements = list(measure(fit, frames, picture_count=0))
    assert [measurement.pictures for measurement in measurements] == [None, None]
