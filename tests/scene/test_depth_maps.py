import dataclasses

import numpy as np
import pytest

from animator.commands.progress_file import run_fingerprint
from animator.errors import InputError
from animator.evaluation.fits import FitRequest
from animator.evaluation.methods import Method
from animator.evaluation.tasks import Assignment
from animator.pipeline import FitConfig
from animator.scene import Scene
from animator.scene.depth_maps import read_depth_maps
from animator.types import Frames
from tests.helpers.textured import textured_box

HEIGHT, WIDTH = 8, 12
RAMP = np.arange(1, HEIGHT * WIDTH + 1).reshape(HEIGHT, WIDTH)
"""No value twice, so that nothing turned, shifted or blended goes unnoticed."""


def clip(*numbers, name="f_{:03d}.png"):
    count = len(numbers)
    return Frames(
        images=np.zeros((count, HEIGHT, WIDTH, 3), np.uint8),
        alphas=np.full((count, HEIGHT, WIDTH), 255, np.uint8),
        numbers=numbers,
        names=tuple(name.format(number) for number in numbers),
        fps=24.0,
    )


def array(folder, name, values, **options):
    path = folder.root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, values, **options)
    return path


def read_one(folder):
    """Read the map of a clip of one frame, from `z/`."""
    return read_depth_maps(clip(0), folder.root / "z")[0]


class TestForms:
    @pytest.mark.parametrize("dtype", ["u1", "i4", "f2", "f4", ">f8"])
    def test_arrays_of_any_real_type(self, folder, dtype):
        array(folder, "z/f_000.npy", RAMP.astype(dtype))
        depth = read_one(folder)
        assert depth.dtype == np.float32
        np.testing.assert_array_equal(depth, RAMP)

    def test_arrays_stored_column_by_column(self, folder):
        array(folder, "z/f_000.npy", np.asfortranarray(RAMP))
        np.testing.assert_array_equal(read_one(folder), RAMP)

    @pytest.mark.parametrize(
        ("name", "values"),
        [
            ("f_000.png", RAMP.astype(np.uint8)),
            ("f_000.png", (RAMP * 600 + 7).astype(np.uint16)),
            ("f_000.PNG", (RAMP * 600 + 7).astype(np.uint16)),
            ("f_000.pgm", RAMP.astype(np.uint8)),
            ("f_000.pgm", (RAMP * 600 + 7).astype(np.uint16)),
            ("f_000.tif", (RAMP * 600 + 7).astype(np.uint16)),
            ("f_000.tiff", (RAMP / 7).astype(np.float32)),
        ],
    )
    def test_gray_images_keep_all_bits(self, folder, name, values):
        folder.image(f"z/{name}", values)
        depth = read_one(folder)
        assert depth.dtype == np.float32
        np.testing.assert_array_equal(depth, values)

    def test_an_array_wins_over_its_picture(self, folder):
        array(folder, "z/f_000.npy", RAMP)
        folder.image("z/f_000.png", (255, 0, 0))
        np.testing.assert_array_equal(read_one(folder), RAMP)


class TestValues:
    def test_zero_negative_and_infinite_are_unknown(self, folder):
        values = np.full((HEIGHT, WIDTH), 2.5)
        values[0, :6] = [0, -1, np.nan, np.inf, -np.inf, 1e300]
        array(folder, "z/f_000.npy", values)
        depth = read_one(folder)
        assert np.isnan(depth[0, :6]).all()
        assert (depth.ravel()[6:] == 2.5).all()

    def test_black_pixels_are_unknown(self, folder):
        folder.image("z/f_000.png", ((RAMP % 2) * 40_000).astype(np.uint16))
        np.testing.assert_array_equal(read_one(folder), np.where(RAMP % 2, 40_000, np.nan))

    def test_maps_that_know_nothing_are_counted_once(self, folder, caplog):
        for number, value in ((4, 1), (5, 0), (9, -1)):
            array(folder, f"z/{number}.npy", np.full((HEIGHT, WIDTH), value))
        depths = read_depth_maps(clip(4, 5, 9), folder.root / "z")
        assert np.isnan(depths[1:]).all()
        (record,) = caplog.records
        assert record.message == (
            "2 of 3 frames have a depth map without any value above zero (5, 9)."
        )


class TestSize:
    def test_nothing_is_blended_where_the_size_differs(self, folder):
        large = np.kron(RAMP, np.ones((3, 3)))
        large[:3, :3] = np.nan
        array(folder, "z/f_000.npy", large)
        expected = RAMP.astype(float)
        expected[0, 0] = np.nan
        np.testing.assert_array_equal(read_one(folder), expected)

    def test_small_maps_are_repeated(self, folder):
        small = RAMP[:4, :6]
        folder.image("z/f_000.png", small.astype(np.uint16))
        np.testing.assert_array_equal(read_one(folder), np.kron(small, np.ones((2, 2))))

    def test_another_shape_is_refused(self, folder):
        array(folder, "z/f_000.npy", RAMP.T)
        with pytest.raises(InputError) as error:
            read_one(folder)
        assert str(error.value) == (
            f"{folder.root / 'z' / 'f_000.npy'}: the depth map has 8x12 pixels, its frame "
            "f_000.png has 12x8, another aspect ratio."
        )


class TestMatching:
    @pytest.mark.parametrize(
        "names",
        [
            ("f_003.npy", "f_007.npy"),
            ("f_003.png.npy", "f_007.png.npy"),
            ("depth0003.npy", "depth0007.npy"),
            ("3.npy", "f_007.png"),
        ],
    )
    def test_by_name_or_number(self, folder, names):
        for name, value in zip(names, (3, 7), strict=True):
            if name.endswith(".npy"):
                array(folder, f"z/{name}", np.full((HEIGHT, WIDTH), value))
            else:
                folder.image(f"z/{name}", np.full((HEIGHT, WIDTH), value, np.uint8))
        array(folder, "z/f_005.npy", RAMP)  # of a frame that is not read
        depths = read_depth_maps(clip(3, 7), folder.root / "z")
        assert depths[:, 0, 0].tolist() == [3, 7]

    def test_by_number_for_a_video(self, folder):
        for number in (0, 2):
            array(folder, f"z/d_{number:05d}.npy", np.full((HEIGHT, WIDTH), number + 1))
        depths = read_depth_maps(clip(0, 2, name="shot.mp4#{}"), folder.root / "z")
        assert depths[:, 0, 0].tolist() == [1, 3]

    def test_missing_maps_are_named(self, folder):
        array(folder, "z/f_000.npy", RAMP)
        folder.image("z/f_001.jpg")  # loses what depth needs: no depth map
        with pytest.raises(InputError) as error:
            read_depth_maps(clip(0, 1, 2), folder.root / "z")
        assert str(error.value) == (
            f"{folder.root / 'z'}: expected a depth map for each of the 3 frames, found none for "
            "2: f_001.png, f_002.png; depth maps are matched by file name (without its ending) or "
            "by their last number."
        )

    def test_a_file_is_no_folder(self, folder):
        path = array(folder, "z/f_000.npy", RAMP)
        with pytest.raises(InputError, match=r"no such folder of depth maps \(--depth\)"):
            read_depth_maps(clip(0), path)


class TestRefused:
    @pytest.mark.parametrize("color", [(200, 40, 40), (90, 90, 90, 255)])
    def test_color_images(self, folder, color):
        folder.image("z/f_000.png", color)
        with pytest.raises(InputError, match=r"f_000\.png: expected a gray .* RGB.*as gray, or"):
            read_one(folder)

    @pytest.mark.parametrize(
        ("values", "found"),
        [
            (RAMP[None].astype(np.float32), r"float32 of shape \(1, 8, 12\)"),
            (RAMP.ravel(), r"int64 of shape \(96,\)"),
            (RAMP + 1j, r"complex128 of shape"),
            (RAMP > 3, r"bool of shape"),
            (np.zeros(RAMP.shape, [("z", "f4")]), r"'z'.* of shape"),
            (np.float32(3), r"float32 of shape \(\)"),
            (RAMP[:0], r"shape \(0, 12\)|cannot be read"),
        ],
    )
    def test_arrays_that_are_no_map(self, folder, values, found):
        array(folder, "z/f_000.npy", values)
        with pytest.raises(InputError, match=rf"f_000\.npy: expected .*({found}).*save"):
            read_one(folder)

    def test_pickles(self, folder):
        array(folder, "z/f_000.npy", np.full(RAMP.shape, None), allow_pickle=True)
        with pytest.raises(InputError, match=r"f_000\.npy: expected one array of real numbers"):
            read_one(folder)

    @pytest.mark.parametrize("content", [b"", b"\x80\x04N.", b"PK\x03\x04", b"\x93NUMPY\x01\x00"])
    def test_files_of_another_kind(self, folder, content):
        folder.text("z/f_000.npy", content)
        with pytest.raises(InputError, match=r"f_000\.npy: expected one array of real numbers"):
            read_one(folder)

    def test_files_that_are_cut_off(self, folder):
        path = array(folder, "z/f_000.npy", RAMP)
        path.write_bytes(path.read_bytes()[:-8])
        with pytest.raises(InputError, match=r"f_000\.npy: expected one array of real numbers"):
            read_one(folder)

    def test_archives(self, folder):
        with (folder.root / "f_000.npy").open("wb") as stream:
            np.savez(stream, depth=RAMP)
        with pytest.raises(InputError, match=r"f_000\.npy: expected one array, found an archive"):
            read_depth_maps(clip(0), folder.root)

    @pytest.mark.filterwarnings("ignore:Corrupt EXIF")
    @pytest.mark.parametrize("suffix", ["png", "tif", "pgm"])
    def test_damaged_images(self, folder, suffix):
        path = folder.image(f"z/f_000.{suffix}", RAMP.astype(np.uint8))
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        with pytest.raises(InputError, match=rf"f_000\.{suffix}: expected a gray image, but"):
            read_one(folder)

    def test_other_formats_by_content(self, folder):
        path = folder.image("z/f_000.jpg", RAMP.astype(np.uint8))
        path.rename(path.with_suffix(".png"))
        with pytest.raises(InputError, match=r"f_000\.png: expected a gray image, but"):
            read_one(folder)


def scene_with(depths):
    return Scene(
        gaussians=textured_box(10),
        capture_cameras=(),
        frames=dataclasses.replace(clip(0, 1), depths=depths),
        frame_cameras=None,
        notes=(),
    )


def kept_fingerprint(scene, config):
    """Return the fingerprint of a kept result of `splatimate evaluate`."""
    assignment = Assignment(
        scene=scene, numbers=(0, 1), scored_numbers=(1,), model_size=10, inbetween=0
    )
    return FitRequest(
        method=Method(summary=""), assignment=assignment, config=config, folder=None, name=""
    ).fingerprint


class TestInTheFrames:
    def test_a_selection_takes_them_along(self):
        depths = np.stack([RAMP, RAMP + 100, RAMP + 200]).astype(np.float32)
        frames = dataclasses.replace(clip(1, 2, 3), depths=depths)
        np.testing.assert_array_equal(frames.take([2, 0]).depths, depths[[2, 0]])
        assert clip(1, 2, 3).take([2, 0]).depths is None

    @pytest.mark.parametrize("fingerprint", [run_fingerprint, kept_fingerprint])
    def test_results_of_other_depths_are_not_taken_for_these(self, fingerprint):
        depths = np.ones((2, HEIGHT, WIDTH), np.float32)
        other = depths.copy()
        other[1, 2, 3] = np.nan
        found = [fingerprint(scene_with(d), FitConfig()) for d in (None, depths, other)]
        assert len(set(found)) == 3
        assert fingerprint(scene_with(other.copy()), FitConfig()) == found[2]
