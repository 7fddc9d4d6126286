import json

import numpy as np
import pytest
from plyfile import PlyData, PlyElement

from animator.errors import InputError
from animator.scene import FrameOptions, SceneOverrides, discover, read_scene

NAMES = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"


@pytest.fixture
def scene(folder):
    """A folder with frames 1..3 of 12x8 pixels, the Gaussians and both cameras."""
    for number in (1, 2, 3):
        folder.image(f"frames/f_{number}.png", (10 * number, 0, 0, 128))
    rows = np.ones(5, [(name, "f4") for name in NAMES.split()])
    PlyData([PlyElement.describe(rows, "vertex")]).write(str(folder.root / "init.ply"))
    cameras(folder, "transforms_train.json", [f"train/{i}.png" for i in range(4)])
    cameras(folder, "transforms_frames.json", ["frames/f_1.png"])
    return folder


def cameras(folder, name, file_paths, offsets=None, width=12, height=8):
    """Write cameras that stand at x = offset; by default all at 0."""
    frames = []
    for index, file_path in enumerate(file_paths):
        matrix = np.eye(4)
        matrix[0, 3] = offsets[index] if offsets else 0
        frames.append({"file_path": file_path, "transform_matrix": matrix.tolist()})
    content = {"fl_x": 10, "w": width, "h": height, "frames": frames}
    return folder.text(name, json.dumps(content))


def camera_places(found):
    return [float(camera.position[0]) for camera in found.frame_cameras]


class TestDiscover:
    def test_beside_the_frames_folder(self, scene):
        files = discover(scene.root / "frames")
        assert files.gaussians.path == scene.root / "init.ply"
        assert files.gaussians.reason == "the only .ply file, found beside the frames"
        assert files.cameras.path.name == "transforms_train.json"
        assert files.frame_camera.path.name == "transforms_frames.json"
        assert files.masks is None
        assert files.depth is None
        assert not any("Depth" in note for note in files.notes())
        assert any("transforms_train.json (found beside" in note for note in files.notes())

    @pytest.mark.parametrize("source", ["frames/f_*.png", "frames/f_%d.png", "frames/f_#.png"])
    def test_beside_a_pattern(self, scene, source):
        assert discover(scene.root / source).gaussians.path == scene.root / "init.ply"

    def test_beside_a_video(self, scene):
        clip = scene.text("clip.mp4")
        assert discover(clip).gaussians.path == scene.root / "init.ply"

    def test_in_the_working_folder(self, scene, monkeypatch):
        monkeypatch.chdir(scene.root / "frames")
        for source in (".", "*.png"):
            assert discover(source).gaussians.path.samefile(scene.root / "init.ply")

    def test_the_frames_folder_comes_first(self, scene):
        scene.text("frames/other.ply")
        scene.text("frames/transforms.json")
        files = discover(scene.root / "frames")
        assert files.gaussians.path.name == "other.ply"
        assert files.gaussians.reason == "the only .ply file, found in the frames' folder"
        assert files.cameras.path.name == "transforms.json"

    def test_flags_win(self, scene):
        overrides = SceneOverrides(
            gaussians=scene.text("a/b.ply"),
            cameras=scene.text("a/c.json"),
            frame_camera=scene.text("a/d.json"),
            masks=scene.text("a/m/0.png").parent,
            depth=scene.text("a/z/0.npy").parent,
        )
        files = discover(scene.root / "frames", overrides)
        found = (files.gaussians, files.cameras, files.frame_camera, files.masks, files.depth)
        assert [item.path.name for item in found] == ["b.ply", "c.json", "d.json", "m", "z"]
        assert [item.reason for item in found] == [
            "--gaussians",
            "--cameras",
            "--frame-camera",
            "--masks",
            "--depth",
        ]
        assert all(item.is_explicit for item in found)
        assert files.notes()[-1] == f"Depth folder: {scene.root / 'a' / 'z'} (--depth)."

    def test_depth_is_never_searched_for(self, scene):
        scene.text("depth/f_1.npy")
        assert discover(scene.root / "frames").depth is None

    def test_auto_asks_to_find_the_clip_camera(self, scene):
        overrides = SceneOverrides(frame_camera="auto")
        assert discover(scene.root / "frames", overrides).frame_camera is None

    @pytest.mark.parametrize("name", ["point_cloud.ply", "model.ply"])
    def test_known_names_settle_several_files(self, scene, name):
        (scene.root / "init.ply").rename(scene.root / name)
        scene.text("a.ply")
        assert discover(scene.root / "frames").gaussians.path.name == name

    def test_masks_and_colmap_folders(self, scene):
        (scene.root / "transforms_train.json").unlink()
        scene.text("sparse/0/cameras.bin")
        scene.text("sparse/0/images.bin")
        scene.text("masks/f_1.png")
        files = discover(scene.root / "frames")
        assert files.cameras.path == scene.root / "sparse" / "0"
        assert files.masks.path == scene.root / "masks"

    def test_two_unknown_splats_are_ambiguous(self, scene):
        (scene.root / "init.ply").unlink()
        scene.text("b.ply")
        scene.text("a.ply")
        with pytest.raises(InputError) as error:
            discover(scene.root / "frames")
        assert str(error.value) == (
            f"{scene.root}: found 2 .ply files (a.ply, b.ply) and none is called init.ply or "
            "point_cloud.ply or model.ply; say which one holds the Gaussians with --gaussians."
        )

    def test_no_splat_says_where_it_was_looked_for(self, scene):
        (scene.root / "init.ply").unlink()
        scene.text("model.spz")
        with pytest.raises(InputError) as error:
            discover(scene.root / "frames")
        assert str(error.value) == (
            f"No Gaussians found: looked for *.ply in {scene.root / 'frames'} and {scene.root}; "
            f"name the splat with --gaussians. {scene.root / 'model.spz'} must be converted to "
            ".ply first."
        )

    def test_an_empty_folder_is_said_to_be_empty_and_not_to_lack_cameras(self, tmp_path):
        (tmp_path / "frames").mkdir()
        with pytest.raises(InputError, match=r"frames: expected the images .* empty folder"):
            discover(tmp_path / "frames")

    def test_no_cameras_at_all(self, scene):
        (scene.root / "transforms_train.json").unlink()
        assert discover(scene.root / "frames").cameras is None  # the clip's own is enough
        with pytest.raises(InputError, match="No cameras found"):
            discover(scene.root / "frames", SceneOverrides(frame_camera="auto"))
        (scene.root / "transforms_frames.json").unlink()
        with pytest.raises(InputError) as error:
            discover(scene.root / "frames")
        assert str(error.value) == (
            "No cameras found: looked for transforms_frames.json, transforms_train.json, "
            f"transforms.json, cameras.json, sparse/0 in {scene.root / 'frames'} and {scene.root}. "
            "Give the cameras the splat was captured with (--cameras), or the camera of the clip "
            "(--frame-camera)."
        )

    @pytest.mark.parametrize("name", ["gaussians", "cameras", "frame_camera", "masks", "depth"])
    def test_named_files_must_exist(self, scene, name):
        overrides = SceneOverrides(**{name: scene.root / "none"})
        flag = "--" + name.replace("_", "-")
        with pytest.raises(InputError, match=rf"none: there is no such file \({flag}\)"):
            discover(scene.root / "frames", overrides)

    def test_frames_must_exist(self, tmp_path):
        with pytest.raises(InputError, match="there is no such file or folder"):
            discover(tmp_path / "none")


class TestReadScene:
    def test_everything_together(self, scene):
        found = read_scene(discover(scene.root / "frames"), FrameOptions(every=2))
        assert len(found.gaussians) == 5
        assert len(found.capture_cameras) == 4
        assert found.frames.numbers == (1, 3)
        assert (found.frames.alphas == 128).all()
        assert len(found.frame_cameras) == 1
        notes = "\n".join(found.notes)
        assert "2 of 3 from" in notes
        assert "24 frames per second (the default)" in notes
        assert "static" in notes
        assert "the images' alpha" in notes

    def test_depth_maps_of_the_frames_that_are_read(self, scene):
        assert read_scene(discover(scene.root / "frames")).frames.depths is None
        for number in (1, 2, 3):
            scene.image(f"z/{number}.png", np.full((8, 12), 1000 * number, np.uint16))
        files = discover(scene.root / "frames", SceneOverrides(depth=scene.root / "z"))
        found = read_scene(files, FrameOptions(every=2, max_size_px=6))
        assert found.frames.depths.shape == (2, 4, 6)
        assert found.frames.depths[:, 0, 0].tolist() == [1000, 3000]
        assert found.notes[-1] == f"Depth: 2 maps from {scene.root / 'z'} (--depth)."

    def test_without_frame_camera(self, scene):
        (scene.root / "transforms_frames.json").unlink()
        found = read_scene(discover(scene.root / "frames"))
        assert found.frame_cameras is None

    def test_cameras_follow_the_downscaling(self, scene, caplog):
        found = read_scene(discover(scene.root / "frames"), FrameOptions(max_size_px=6))
        (camera,) = found.frame_cameras
        assert (camera.width_px, camera.height_px) == (6, 4)
        np.testing.assert_array_equal(camera.intrinsics, [[5, 0, 3], [0, 5, 2], [0, 0, 1]])
        assert "averaged down from 12x8" in found.notes[0]
        assert not caplog.records

    def test_camera_of_another_size(self, scene, caplog):
        cameras(scene, "transforms_frames.json", ["x.png"], width=24, height=16)
        (camera,) = read_scene(discover(scene.root / "frames")).frame_cameras
        assert camera.intrinsics[0].tolist() == [5, 0, 6]
        assert "scaled the intrinsics of 1 camera(s) from 24x16" in caplog.text

    def test_moving_cameras_are_matched_by_name(self, scene):
        cameras(scene, "transforms_frames.json", ["f_3", "b/f_1.png", "f_2.jpg"], [3, 1, 2])
        found = read_scene(discover(scene.root / "frames"), FrameOptions(numbers=(1, 3)))
        assert camera_places(found) == [1, 3]
        assert "moving, 2 poses" in found.notes[3]

    def test_moving_cameras_are_matched_by_number(self, scene):
        cameras(scene, "transforms_frames.json", ["c003.png", "c001.png", "c002.png"], [3, 1, 2])
        assert camera_places(read_scene(discover(scene.root / "frames"))) == [1, 2, 3]

    def test_numbers_of_another_clip_are_suspicious(self, scene, caplog):
        cameras(scene, "transforms_frames.json", [f"r_{i}.png" for i in range(9)], [*range(9)])
        assert camera_places(read_scene(discover(scene.root / "frames"))) == [1, 2, 3]
        assert "9 cameras with 3 frames by number only" in caplog.text

    @pytest.mark.parametrize(
        ("options", "names", "expected"),
        [
            (FrameOptions(), "abc", [7, 8, 9]),
            (FrameOptions(every=2), "abc", [7, 9]),
            (FrameOptions(every=2), "ab", [7, 8]),
        ],
    )
    def test_unnamed_cameras_are_matched_by_order(self, scene, caplog, options, names, expected):
        cameras(scene, "transforms_frames.json", list(names), [7, 8, 9])
        assert camera_places(read_scene(discover(scene.root / "frames"), options)) == expected
        assert "matched by order" in caplog.text

    def test_cameras_that_stand_still_are_one(self, scene):
        cameras(scene, "transforms_frames.json", ["f_1", "f_2", "f_3"])
        assert len(read_scene(discover(scene.root / "frames")).frame_cameras) == 1

    def test_frames_without_camera_are_named(self, scene):
        cameras(scene, "transforms_frames.json", ["f_1", "f_3"], [1, 3])
        with pytest.raises(InputError, match=r"3 frames, found 2 cameras and none for f_2\.png;"):
            read_scene(discover(scene.root / "frames"))
