"""All formats describe the same view, calculated by hand.

The camera stands at (1, 2, 3), looks along world +x, world +z is up, so world -y is right. The
point (11, 1, 4) is 10 in front, 1 to the right, 1 up. With fx = 100, fy = 120 and the principal
point (30, 20) it lands at (30 + 100 / 10, 20 - 120 / 10) = (40, 8).
"""

import json
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from animator.errors import InputError
from animator.scene import read_cameras, scale_camera
from animator.scene.pinhole import fit_cameras

POINT = np.array([[11.0, 1.0, 4.0]])
PIXEL = [40.0, 8.0]
DEPTH = 10.0

OPENGL_C2W = [[0, 0, -1, 1], [-1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]
OPENCV_C2W_ROTATION = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
COLMAP_QUAT_WXYZ = (0.5, 0.5, -0.5, 0.5)
COLMAP_TRANSLATION = (2.0, 3.0, -1.0)
LENS = {"fl_x": 100, "fl_y": 120, "cx": 30, "cy": 20, "w": 64, "h": 48}


def assert_sees_point(camera, pixel=PIXEL):
    pixels, depths = camera.project(POINT)
    np.testing.assert_allclose(pixels[0], pixel, atol=1e-9)
    np.testing.assert_allclose(depths, DEPTH, atol=1e-9)
    np.testing.assert_allclose(camera.position, [1, 2, 3], atol=1e-9)
    assert camera.cam_from_world.dtype == camera.intrinsics.dtype == np.float64


def transforms(folder, frames=None, name="transforms.json", **shared):
    frames = frames or [{}]
    frames = [{"file_path": "./a/r_0.png", "transform_matrix": OPENGL_C2W} | f for f in frames]
    return folder.text(name, json.dumps(shared | {"frames": frames}))


class TestNerfstudio:
    def test_opengl_pose(self, folder):
        (camera,) = read_cameras(transforms(folder, **LENS))
        assert_sees_point(camera)
        assert (camera.width_px, camera.height_px, camera.name) == (64, 48, "a/r_0.png")

    def test_three_rows_and_scaled_axes(self, folder):
        matrix = np.array(OPENGL_C2W, float)[:3]
        matrix[:, :3] *= 2.5
        (camera,) = read_cameras(
            transforms(folder, [{"transform_matrix": matrix.tolist()}], **LENS)
        )
        assert_sees_point(camera)

    def test_field_of_view(self, folder):
        # tan(angle / 2) = 0.32, so that 0.5 * 64 / 0.32 = 100 pixels along both axes.
        angle = 2 * np.arctan(0.32)
        (camera,) = read_cameras(transforms(folder, camera_angle_x=angle, w=64, h=48))
        assert_sees_point(camera, [32 + 100 / 10, 24 - 100 / 10])

    def test_a_frame_overrides_the_top(self, folder):
        angle = 2 * np.arctan(0.32)
        frames = [{}, {"fl_x": 200, "w": 128}, {"camera_angle_x": angle}]
        shared = LENS | {"fl_x": 50}
        first, second, third = read_cameras(transforms(folder, frames, **shared))
        assert first.intrinsics[0, 0] == 50
        assert (second.intrinsics[0, 0], second.width_px) == (200, 128)
        assert third.intrinsics[0, 0] == pytest.approx(100)

    @pytest.mark.parametrize("file_path", ["pics/7.png", "./pics/7"])
    def test_size_is_taken_from_the_image(self, folder, file_path):
        folder.image("pics/7.png", np.zeros((48, 64, 3), np.uint8))
        lens = {key: LENS[key] for key in ("fl_x", "fl_y", "cx", "cy")}
        (camera,) = read_cameras(transforms(folder, [{"file_path": file_path}], **lens))
        assert (camera.width_px, camera.height_px) == (64, 48)

    @pytest.mark.parametrize("file_path", ["../secret.png", "/etc/secret.png", "a/../../x.png"])
    def test_images_outside_are_not_opened(self, folder, file_path):
        path = transforms(folder, [{"file_path": file_path}], name="in/t.json", fl_x=100)
        with pytest.raises(InputError, match=r"outside .*add w and h"):
            read_cameras(path)

    def test_distortion_and_processing_are_reported(self, folder, caplog):
        shared = LENS | {"k1": 0.1, "k2": 0.0, "p1": -0.2, "applied_transform": OPENGL_C2W}
        assert_sees_point(read_cameras(transforms(folder, [{}, {"k1": -0.3}], **shared))[0])
        assert "distortion of 2 of 2 cameras (largest coefficient 0.3)" in caplog.text
        assert "dataparser_transforms.json" in caplog.text

    def test_zero_distortion_is_silent(self, folder, caplog):
        read_cameras(transforms(folder, **LENS, k1=0, k2=0.0, camera_model="OPENCV"))
        assert not caplog.records

    @pytest.mark.parametrize(
        ("shared", "frame", "expected"),
        [
            ({"camera_model": "OPENCV_FISHEYE"}, {}, "found 'OPENCV_FISHEYE'; undistort"),
            ({"fl_x": "100"}, {}, "fl_x: expected a number, found '100'"),
            ({"fl_x": True}, {}, "fl_x: expected a number, found True"),
            ({"fl_x": float("nan")}, {}, "fl_x: expected a finite number, found nan"),
            ({"fl_x": -5}, {}, "focal length x: expected a positive number of pixels, found -5"),
            ({"w": 0}, {}, "image width: expected 1..131072 pixels, found 0"),
            ({"w": 10**9}, {}, "image width"),
            ({}, {"transform_matrix": None}, "frames[0]: the field transform_matrix is missing"),
            ({}, {"transform_matrix": [[1, 2], [3]]}, "expected 4x4 or 3x4 numbers"),
            ({}, {"transform_matrix": np.eye(2).tolist()}, "found an array of shape (2, 2)"),
            ({}, {"transform_matrix": np.diag([1, 1, -1, 1]).tolist()}, "is the matrix mirrored"),
            ({}, {"transform_matrix": np.diag([1, 2, 1, 1]).tolist()}, "axis lengths 1 to 2"),
            ({}, {"transform_matrix": np.zeros((4, 4)).tolist()}, "expected a rotation"),
        ],
    )
    def test_wrong_fields_are_named(self, folder, shared, frame, expected):
        path = transforms(folder, [frame], **(LENS | shared))
        with pytest.raises(InputError) as error:
            read_cameras(path)
        assert str(path) in str(error.value)
        assert expected in str(error.value)

    def test_no_focal_length(self, folder):
        with pytest.raises(InputError, match="none of fl_x, fl_y, camera_angle_x"):
            read_cameras(transforms(folder, w=64, h=48))


class TestInria:
    ENTRY = {  # noqa: RUF012 - read only
        "id": 0, "img_name": "a.png", "width": 64, "height": 48, "fx": 100, "fy": 120,
        "position": [1, 2, 3], "rotation": OPENCV_C2W_ROTATION,
    }  # fmt: skip

    def test_opencv_pose_and_centered_principal_point(self, folder):
        path = folder.text("cameras.json", json.dumps([self.ENTRY]))
        (camera,) = read_cameras(path)
        assert_sees_point(camera, [32 + 100 / 10, 24 - 120 / 10])
        assert camera.name == "a.png"

    def test_missing_field_is_named(self, folder):
        entries = [self.ENTRY, {k: v for k, v in self.ENTRY.items() if k != "position"}]
        path = folder.text("cameras.json", json.dumps(entries))
        with pytest.raises(InputError, match="camera 1: the field position is missing"):
            read_cameras(path)


def colmap_text(folder, camera="1 PINHOLE 64 48 100 120 30 20", images=None):
    pose = " ".join(map(str, (*COLMAP_QUAT_WXYZ, *COLMAP_TRANSLATION)))
    images = images or f"# comment\n2 {pose} 1 b 10.png\n\n1 {pose} 1 b 9.png\n1.5 2.5 -1\n"
    folder.text("sparse/0/cameras.txt", f"# comment\n{camera}\n")
    return folder.text("sparse/0/images.txt", images).parent


def colmap_binary(folder, model_id, parameters):
    cameras = struct.pack("<QiiQQ", 1, 7, model_id, 64, 48)
    cameras += struct.pack(f"<{len(parameters)}d", *parameters)
    folder.text("sparse/0/cameras.bin", cameras)
    image = struct.pack("<i7di", 3, *COLMAP_QUAT_WXYZ, *COLMAP_TRANSLATION, 7)
    points = struct.pack("<Qddqddq", 2, 1.5, 2.5, -1, 3.5, 4.5, 9)
    images = struct.pack("<Q", 2) + image + b"b.png\0" + points
    images += image + b"a.png\0" + struct.pack("<Q", 0)
    return folder.text("sparse/0/images.bin", images).parent


class TestColmap:
    def test_text(self, folder, caplog):
        cameras = read_cameras(colmap_text(folder))
        assert [camera.name for camera in cameras] == ["b 9.png", "b 10.png"]
        for camera in cameras:
            assert_sees_point(camera)
        assert not caplog.records

    @pytest.mark.parametrize(
        ("model_id", "parameters", "pixel", "is_distorted"),
        [
            (0, (100, 30, 20), [40, 10], False),
            (1, (100, 120, 30, 20), PIXEL, False),
            (2, (100, 30, 20, 0.1), [40, 10], True),
            (3, (100, 30, 20, 0.1, 0), [40, 10], True),
            (4, (100, 120, 30, 20, 0, 0, 0, 0), PIXEL, False),
            (4, (100, 120, 30, 20, 0, 0, 0, -0.1), PIXEL, True),
            (6, (100, 120, 30, 20, *[0.1] * 8), PIXEL, True),
        ],
    )
    def test_binary_models(self, folder, caplog, model_id, parameters, pixel, is_distorted):
        path = colmap_binary(folder, model_id, parameters)
        for place in (path, path.parent, path.parent.parent, path / "images.bin"):
            cameras = read_cameras(place)
            assert [camera.name for camera in cameras] == ["a.png", "b.png"]
            assert_sees_point(cameras[0], pixel)
        assert ("distortion" in caplog.text) == is_distorted

    @settings(derandomize=True, max_examples=20, deadline=None)
    @given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1))
    def test_quaternions_agree_with_scipy(self, tmp_path_factory, quat_wxyz):
        folder = tmp_path_factory.mktemp("colmap")
        (folder / "cameras.txt").write_text("1 PINHOLE 64 48 100 120 30 20\n")
        numbers = " ".join(repr(value) for value in (*quat_wxyz, 0.0, 0.0, 0.0))
        (folder / "images.txt").write_text(f"1 {numbers} 1 a.png\n\n")
        (camera,) = read_cameras(folder)
        expected = Rotation.from_quat(quat_wxyz, scalar_first=True).as_matrix()
        np.testing.assert_allclose(camera.cam_from_world[:3, :3], expected, atol=1e-12)

    def test_fisheye_is_refused(self, folder):
        with pytest.raises(InputError, match="found the model OPENCV_FISHEYE; run `colmap"):
            read_cameras(colmap_binary(folder, 5, (100, 120, 30, 20, 0, 0, 0, 0)))

    @pytest.mark.parametrize("name", ["cameras.bin", "images.bin"])
    def test_every_cut_is_noticed(self, folder, name):
        path = colmap_binary(folder, 1, (100, 120, 30, 20)) / name
        data = path.read_bytes()
        for length in range(len(data)):
            path.write_bytes(data[:length])
            with pytest.raises(InputError, match=name):
                read_cameras(path.parent)

    @pytest.mark.parametrize(
        ("position", "expected"),
        [(20, "unit quaternion"), (44, "pose of finite numbers")],  # QX, TX
        ids=["quaternion", "translation"],
    )
    def test_binary_nan_is_refused(self, folder, position, expected):
        path = colmap_binary(folder, 1, (100, 120, 30, 20)) / "images.bin"
        data = bytearray(path.read_bytes())
        data[position : position + 8] = struct.pack("<d", np.nan)
        path.write_bytes(data)
        with pytest.raises(InputError, match=expected):
            read_cameras(path)

    def test_binary_principal_point_must_be_finite(self, folder):
        with pytest.raises(InputError, match=r"principal point: .* found \(nan, 20"):
            read_cameras(colmap_binary(folder, 1, (100, 120, np.nan, 20)))

    def test_absurd_count_is_refused(self, folder):
        path = colmap_binary(folder, 1, (100, 120, 30, 20))
        (path / "images.bin").write_bytes(struct.pack("<Q", 2**62) + bytes(100))
        with pytest.raises(InputError, match="promises 4,611,686,018,427,387,904 items"):
            read_cameras(path)

    @pytest.mark.parametrize(
        ("camera", "images", "expected"),
        [
            ("1 PINHOLE 64 48 100 120 30", None, "line 2: expected 4 parameters for PINHOLE"),
            ("1 LENS 64 48 100", None, "expected CAMERA_ID MODEL WIDTH HEIGHT"),
            ("1 PINHOLE 64 48 x 120 30 20", None, "expected a finite number, found 'x'"),
            ("9 PINHOLE 64 48 100 120 30 20", None, "refers to camera 1, which is not among"),
            ("1 PINHOLE 64 48 100 120 30 20", "1 0 0 0 0 0 0 0 1 a.png\n\n", "unit quaternion"),
            ("1 PINHOLE 64 48 100 120 30 20", "1 1 0 0 0 0 0\n\n", "expected IMAGE_ID QW QX"),
            ("1 PINHOLE 64 48 100 120 30 20", "# none\n", "expected registered images"),
        ],
    )
    def test_malformed_text(self, folder, camera, images, expected):
        with pytest.raises(InputError, match=expected):
            read_cameras(colmap_text(folder, camera, images))


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.json", "{", "expected JSON, found something else"),
        ("a.json", b"\xff\xfe\x00", "expected JSON"),
        ("a.json", "[" * 100_000, "expected JSON"),
        ("a.json", "[]", "at least one camera, found none"),
        ("a.json", '{"frames": []}', "frames: expected a list with at least one entry"),
        ("a.json", '{"frames": [3]}', r"frames\[0\]: expected a JSON object, found 3"),
        ("a.json", '{"cameras": 1}', "found JSON without a list"),
        ("a.xml", "<a/>", "found a .xml file"),
    ],
)
def test_files_without_cameras(folder, name, content, expected):
    path = folder.text(name, content)
    with pytest.raises(InputError, match=expected) as error:
        read_cameras(path)
    assert str(path) in str(error.value)


def test_missing_camera_file(tmp_path):
    with pytest.raises(InputError) as error:
        read_cameras(tmp_path / "transforms.json")
    assert str(error.value) == (
        f"{tmp_path / 'transforms.json'}: there is no such camera file. Known formats: "
        "transforms.json (nerfstudio, Blender), cameras.json (INRIA) or a COLMAP model (the "
        "folder with cameras and images, .bin or .txt)."
    )


def test_empty_folder_is_no_colmap_model(tmp_path):
    with pytest.raises(InputError, match="COLMAP model, found neither there"):
        read_cameras(tmp_path)


class TestSize:
    def test_scaling_keeps_the_relative_position(self, folder):
        (camera,) = read_cameras(transforms(folder, **LENS))
        # Twice as wide, half as high: (40, 8) moves to (80, 4).
        assert_sees_point(scale_camera(camera, 128, 24), [80.0, 4.0])

    def test_other_size_of_the_same_shape_scales_with_a_warning(self, folder, caplog):
        cameras = read_cameras(transforms(folder, **LENS))
        (fitted,) = fit_cameras(cameras, 32, 24, where="t.json")
        assert_sees_point(fitted, [20.0, 4.0])
        assert "from 64x48 to the frames' 32x24" in caplog.text

    def test_same_size_is_silent(self, folder, caplog):
        fit_cameras(read_cameras(transforms(folder, **LENS)), 64, 48, where="t.json")
        assert not caplog.records

    def test_other_shape_is_refused(self, folder):
        cameras = read_cameras(transforms(folder, **LENS))
        with pytest.raises(InputError, match="64x48 pixels, the frames have 48x64"):
            fit_cameras(cameras, 48, 64, where="t.json")
