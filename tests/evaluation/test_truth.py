import numpy as np
import pytest

from animator.errors import InputError
from animator.evaluation.held_out_views import read_held_out_views
from animator.evaluation.truth_scene import find_scenes, read_truth_scene
from tests.evaluation.conftest import FRAME_COUNT, FRONT, STEP, side_camera


def rewrite(path, **changes) -> None:
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays |= changes
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})


def test_a_scene_of_points(master_scene, renderer):
    scene = read_truth_scene(master_scene, renderer)
    truth = scene.truth
    assert scene.name == "box"
    assert truth.points.shape == (FRAME_COUNT, 200, 3)
    np.testing.assert_allclose(
        truth.points[2] - truth.points[0], np.tile(2 * STEP, (200, 1)), atol=1e-6
    )
    assert truth.is_outer.sum() == 180
    assert truth.part_names == ("left", "right")
    assert truth.has_rigid_parts
    assert truth.diagonal == pytest.approx(np.linalg.norm(np.ptp(truth.points[0], axis=0)))
    np.testing.assert_allclose(scene.cameras[3].cam_from_world, FRONT.cam_from_world, atol=1e-9)
    assert [view.number for view in scene.held_out] == list(range(FRAME_COUNT))
    assert {view.name for view in scene.held_out} == {"side"}
    np.testing.assert_allclose(
        scene.held_out[0].camera.cam_from_world, side_camera().cam_from_world, atol=1e-9
    )
    drawn = scene.held_out[0].picture()
    assert drawn.rgb[drawn.alpha == 0].max() == 0
    assert drawn.alpha.max() == 1


def test_parts_of_one_group_are_one_part_named_after_its_largest(scene, renderer):
    rewrite(
        scene / "gt_points.npz",
        point_part=np.repeat([0, 1, 2], [20, 100, 80]),
        part_group=np.array([0, 0, 1, 1]),
        part_names=np.array(["small", "large", "other", "without points"]),
    )
    truth = read_truth_scene(scene, renderer).truth
    assert truth.part_names == ("large and 1 more", "other")
    assert np.bincount(truth.part_ids).tolist() == [120, 80]


def test_points_without_parts_or_views(scene, renderer):
    changes = {"point_part": None, "part_group": None, "point_train_views": None}
    rewrite(scene / "gt_points.npz", **changes)
    truth = read_truth_scene(scene, renderer).truth
    assert truth.is_outer.all()
    assert not truth.has_rigid_parts
    assert set(truth.part_ids) == {-1}


def test_a_scene_of_rigid_parts_of_its_own_gaussians(scene, renderer, box):
    (scene / "gt_points.npz").unlink()
    motions = np.tile(np.eye(4), (FRAME_COUNT, 2, 1, 1))
    motions[:, 1, :3, 3] = STEP * np.arange(FRAME_COUNT)[:, None]
    part_ids = (box.means[:, 0].numpy() > 0).astype(np.int8)
    np.savez(scene / "true_motion.npz", part_ids=part_ids, posed_from_rest=motions)
    truth = read_truth_scene(scene, renderer).truth
    moved = np.linalg.norm(truth.points[3] - truth.points[0], axis=1)
    np.testing.assert_allclose(moved, part_ids * 3 * np.linalg.norm(STEP), atol=1e-9)
    assert truth.gaussian_ids.tolist() == list(range(len(box)))
    # The camera is on the -z side: it sees that face of the box, and not the one behind.
    depths = box.means[:, 2].numpy()
    assert truth.is_seen[0][depths < -0.29].mean() > 0.9
    assert truth.is_seen[0][depths > 0.29].mean() < 0.3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": None}, "points"),
        ({"points": np.zeros((4, 200))}, r"\(T, P, 3\)"),
        ({"points": np.full((4, 200, 3), np.nan)}, "finite"),
        ({"point_visible": np.zeros((4, 7), bool)}, "point_visible"),
        ({"part_group": np.array([0])}, "part_group"),
        (
            {"points": np.zeros((3, 200, 3)), "point_visible": np.zeros((3, 200), bool)},
            "4 frames of the clip",
        ),
    ],
)
def test_a_truth_that_does_not_fit_is_refused(scene, renderer, changes, message):
    rewrite(scene / "gt_points.npz", **changes)
    with pytest.raises(InputError, match=message):
        read_truth_scene(scene, renderer)


def test_what_is_no_archive_is_refused(scene, renderer):
    (scene / "gt_points.npz").write_bytes(b"PK\x03\x04 not really")
    with pytest.raises(InputError, match="gt_points"):
        read_truth_scene(scene, renderer)


def test_the_true_camera_is_needed(scene, renderer):
    (scene / "transforms_frames.json").rename(scene / "transforms_train.json")
    with pytest.raises(InputError, match="true camera"):
        read_truth_scene(scene, renderer)


def test_held_out_pictures_lie_in_the_scene(scene):
    path = scene / "transforms_eval.json"
    path.write_text(path.read_text().replace("eval/side/00000.png", "../elsewhere/00000.png"))
    with pytest.raises(InputError, match="in the scene"):
        read_held_out_views(scene)
    path.unlink()
    assert read_held_out_views(scene) == ()


def test_scenes_are_found_in_folders(master_scene, scene):
    assert find_scenes([master_scene]) == (master_scene,)
    assert find_scenes([master_scene.parent]) == (master_scene,)
    with pytest.raises(InputError, match="Two scenes"):
        find_scenes([master_scene, scene])
    with pytest.raises(InputError, match=r"docs/evaluation\.md"):
        find_scenes([scene / "frames"])
