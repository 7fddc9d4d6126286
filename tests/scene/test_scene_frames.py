import dataclasses

import cv2
import numpy as np
import pytest
from PIL import Image

from animator.errors import InputError
from animator.scene import FrameOptions, frame_stack, open_frames, read_frames, select_frames
from animator.scene.frames import read_clip
from animator.scene.image_file import image_size_px


def gray_level(frames):
    """Return the mean of each frame, by which the tests tell them apart."""
    return [round(float(image.mean())) for image in frames.images]


@pytest.fixture
def sequence(folder):
    """Frames 8 to 11, each as bright as ten times its number, and files to be ignored."""
    for number in (8, 9, 10, 11):
        folder.image(f"shot/f_{number}.png", (10 * number,) * 3)
    folder.text("shot/._f_8.png", "macOS")
    folder.text("shot/notes.txt", "notes")
    folder.image("shot/sub/f_1.png")
    return folder.root / "shot"


@pytest.fixture
def video(tmp_path):
    """Seven frames of 64x48 at 12.5 fps, as bright as thirty times their number."""
    path = tmp_path / "clip %04d.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 12.5, (64, 48))
    for number in range(7):
        writer.write(np.full((48, 64, 3), 30 * number, np.uint8))
    writer.release()
    return path


class TestSources:
    @pytest.mark.parametrize(
        "pattern", ["", "f_*.png", "*_*.png", "f_%d.png", "f_%1d.png", "f_#.png"]
    )
    def test_naturally_ordered_with_original_numbers(self, sequence, pattern):
        frames = read_frames(sequence / pattern)
        assert frames.numbers == (8, 9, 10, 11)
        assert frames.names == ("f_8.png", "f_9.png", "f_10.png", "f_11.png")
        assert gray_level(frames) == [80, 90, 100, 110]
        assert frames.images.shape == (4, 8, 12, 3)
        assert frames.images.dtype == frames.alphas.dtype == np.uint8
        assert (frames.alphas == 255).all()
        assert frames.fps == 24

    @pytest.mark.parametrize("pattern", ["a.%03d.png", "a.###.png"])
    def test_padded_patterns_take_only_their_width(self, folder, pattern):
        for name in ("a.007.png", "a.1000.png", "a.08.png", "a.0009.png", "ab.007.png"):
            folder.image(name)
        assert read_frames(folder.root / pattern).names == ("a.007.png", "a.1000.png")

    def test_the_pattern_says_which_number_counts(self, folder):
        folder.image("3_take2.png")
        folder.image("5_take2.png")
        assert read_frames(folder.root / "%d_take2.png").numbers == (3, 5)

    def test_single_image(self, sequence):
        assert read_frames(sequence / "f_9.png").numbers == (9,)

    def test_through_a_symlink_and_dots(self, sequence, tmp_path):
        (tmp_path / "link").symlink_to(sequence)
        assert len(read_frames(tmp_path / "link" / ".." / "link")) == 4

    def test_gaps_are_listed(self, folder, caplog):
        for number in (1, 2, 5, 7):
            folder.image(f"{number}.png")
        assert read_frames(folder.root).numbers == (1, 2, 5, 7)
        assert "2 gap(s), missing: 3-4, 6" in caplog.text

    def test_video_counts_from_zero(self, video):
        frames = read_frames(video)
        assert frames.numbers == tuple(range(7))
        assert frames.names[3] == "clip %04d.avi#3"
        assert frames.fps == 12.5
        np.testing.assert_allclose(gray_level(frames), 30 * np.arange(7), atol=3)
        assert (frames.alphas == 255).all()

    def test_video_colors_are_rgb(self, tmp_path):
        path = tmp_path / "red.avi"
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
        writer.write(np.full((48, 64, 3), (0, 0, 255), np.uint8))  # OpenCV writes BGR
        writer.release()
        red, green, blue = read_frames(path).images[0, 20, 20].astype(int)
        assert red > 200 and max(green, blue) < 60

    def test_uneven_video_is_reported(self, tmp_path, caplog):
        pictures = [Image.new("L", (32, 32), 40 * number) for number in range(6)]
        durations_ms = [100, 100, 100, 2000, 100, 100]
        path = tmp_path / "clip.gif"
        pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=durations_ms)
        assert len(read_frames(path)) == 6
        assert "variable frame rate" in caplog.text

    def test_video_describes_itself_without_decoding(self, video):
        source = open_frames(video)
        assert (source.width_px, source.height_px, source.frame_count) == (64, 48, 7)


class TestOptions:
    @pytest.mark.parametrize("name", ["sequence", "video"])
    def test_every(self, request, name):
        source = request.getfixturevalue(name)
        assert read_frames(source, FrameOptions(every=3)).numbers == (
            (8, 11) if name == "sequence" else (0, 3, 6)
        )

    def test_original_numbers(self, sequence, video):
        assert gray_level(read_frames(sequence, FrameOptions(numbers=(11, 8)))) == [80, 110]
        picked = read_frames(video, FrameOptions(numbers=(1, 4)))
        assert picked.numbers == (1, 4)
        np.testing.assert_allclose(gray_level(picked), [30, 120], atol=3)

    def test_selecting_later_is_the_same(self, sequence):
        frames = select_frames(read_frames(sequence), numbers=[9, 11])
        assert frames.names == ("f_9.png", "f_11.png")
        assert select_frames(read_frames(sequence), every=2).numbers == (8, 10)

    def test_absent_numbers_are_named(self, sequence, video):
        with pytest.raises(InputError, match=r"no frame 3, 12; the clip has 4 frames .* 8 to 11"):
            read_frames(sequence, FrameOptions(numbers=(12, 9, 3)))
        with pytest.raises(InputError, match=r"no frame 7; the clip has 7 frames .* 0 to 6"):
            read_frames(video, FrameOptions(numbers=(0, 7)))

    @pytest.mark.parametrize(
        "options",
        [
            {"numbers": (1,), "every": 2},
            {"numbers": ()},
            {"every": 0},
            {"fps": 0.0},
            {"fps": float("nan")},
            {"max_size_px": 0},
        ],
    )
    def test_senseless_options(self, sequence, options):
        with pytest.raises(InputError, match=r"--|max_size_px"):
            read_frames(sequence, FrameOptions(**options))

    def test_the_flag_beats_the_container(self, video):
        assert read_frames(video, FrameOptions(fps=30.0)).fps == 30

    def test_only_the_selection_is_decoded(self, sequence):
        (sequence / "f_9.png").write_bytes(b"broken")
        assert read_frames(sequence, FrameOptions(every=2)).numbers == (8, 10)

    def test_downscaling_averages_by_coverage(self, folder):
        pixels = np.zeros((2, 4, 4), np.uint8)
        pixels[:, 0] = (200, 100, 50, 255)
        pixels[:, 1] = (0, 255, 255, 0)  # transparent: its color must not bleed
        pixels[:, 2] = (100, 0, 0, 255)
        pixels[:, 3] = (200, 0, 0, 255)
        folder.image("a.png", pixels)
        frames = read_frames(folder.root, FrameOptions(max_size_px=2))
        assert frames.images[0].tolist() == [[[200, 100, 50], [150, 0, 0]]]
        assert frames.alphas[0].tolist() == [[128, 255]]

    def test_downscaling_leaves_small_frames_alone(self, sequence):
        assert read_frames(sequence, FrameOptions(max_size_px=12)).images.shape[1:3] == (8, 12)

    def test_video_longer_than_promised(self, video):
        source = dataclasses.replace(open_frames(video), frame_count=2)
        frames = read_clip(source, FrameOptions()).frames
        np.testing.assert_allclose(gray_level(frames), 30 * np.arange(7), atol=3)

    def test_downscaling_opaque_frames(self, folder):
        pixels = np.zeros((2, 4, 3), np.uint8)
        pixels[0, :2] = 200
        folder.image("a.png", pixels)
        frames = read_frames(folder.root, FrameOptions(max_size_px=2))
        assert frames.images[0, 0, :, 0].tolist() == [100, 0]
        assert (frames.alphas == 255).all()

    def test_too_much_for_memory_is_refused(self, sequence, monkeypatch):
        monkeypatch.setattr(frame_stack, "_MAX_BYTES", 3 * 4 * 8 * 12)
        with pytest.raises(InputError, match=r"more than 3 frames of 12x8 pixels .*--every"):
            read_frames(sequence)
        assert len(read_frames(sequence, FrameOptions(every=2))) == 2


class TestPixels:
    def test_straight_alpha(self, folder):
        folder.image("a.png", (200, 100, 50, 64))
        frames = read_frames(folder.root)
        assert frames.images[0, 0, 0].tolist() == [200, 100, 50]
        assert frames.alphas[0, 0, 0] == 64

    @pytest.mark.parametrize("channels", [1, 3, 4])
    def test_sixteen_bits(self, folder, channels):
        shape = (4, 4) if channels == 1 else (4, 4, channels)
        path = folder.root / "a.png"
        cv2.imwrite(str(path), np.full(shape, 257 * 77, np.uint16))
        frames = read_frames(path)
        assert (frames.images == 77).all()
        assert (frames.alphas == (77 if channels == 4 else 255)).all()

    def test_gray_and_palette(self, folder):
        Image.new("L", (3, 2), 90).save(folder.root / "1.png")
        Image.new("LA", (3, 2), (90, 30)).save(folder.root / "2.png")
        Image.new("RGB", (3, 2), (90, 90, 90)).quantize(4).save(folder.root / "3.png")
        frames = read_frames(folder.root)
        assert (frames.images == 90).all()
        assert frames.alphas[:, 0, 0].tolist() == [255, 30, 255]

    def test_exif_rotation(self, folder):
        pixels = np.zeros((2, 3, 3), np.uint8)
        pixels[0, 0] = 255  # the top-left pixel as stored
        exif = Image.Exif()
        exif[0x0112] = 6  # show it turned clockwise by 90 degrees
        path = folder.image("a.png", pixels, exif=exif)
        frames = read_frames(path)
        assert frames.images.shape == (1, 3, 2, 3)
        assert frames.images[0, 0, 1, 0] == 255  # now at the top right
        assert image_size_px(path) == (2, 3)


class TestErrors:
    def test_two_sizes(self, folder):
        folder.image("0.png")
        folder.image("1.png")
        folder.image("2.png", np.zeros((8, 13, 3), np.uint8))
        with pytest.raises(InputError) as error:
            read_frames(folder.root)
        assert str(error.value) == (
            f"{folder.root}: the frames differ in size: 0.png has 12x8 pixels, 2.png has 13x8; "
            "bring them to one size, or select frames of one size with --frames."
        )

    def test_empty_folder(self, folder):
        with pytest.raises(InputError) as error:
            read_frames(folder.root)
        assert str(error.value).startswith(f"{folder.root}: expected images (.bmp, .jpeg, .jpg,")
        assert str(error.value).endswith("found no files; is this the folder of the frames?")

    def test_folder_of_other_files(self, folder):
        folder.text("a.exr")
        folder.text("b.exr")
        with pytest.raises(InputError, match=r"found 2 \.exr files"):
            read_frames(folder.root)

    def test_missing(self, tmp_path):
        with pytest.raises(InputError, match="there is no such file or folder"):
            read_frames(tmp_path / "none")

    @pytest.mark.parametrize("pattern", ["g_%d.png", "g_*.png", "g_####.png"])
    def test_nothing_matches(self, sequence, pattern):
        with pytest.raises(InputError, match=r"pattern"):
            read_frames(sequence / pattern)

    def test_two_number_fields(self, sequence):
        with pytest.raises(InputError, match="expected one number field, found 2"):
            read_frames(sequence / "f_%d_%d.png")

    def test_damaged_image(self, sequence):
        path = sequence / "f_9.png"
        path.write_bytes(path.read_bytes()[:45])
        with pytest.raises(InputError, match=r"f_9\.png: expected an image"):
            read_frames(sequence)

    def test_pixel_bomb(self, folder, monkeypatch):
        path = folder.image("bomb.png", np.zeros((40, 40, 3), np.uint8))
        monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
        with pytest.raises(InputError, match=r"bomb\.png.*1600 pixels"):
            read_frames(path)

    def test_floating_point_image(self, folder):
        Image.fromarray(np.zeros((4, 4), np.float32)).save(folder.root / "a.tiff")
        with pytest.raises(InputError, match="found floating-point pixels"):
            read_frames(folder.root)

    def test_other_file(self, folder):
        with pytest.raises(InputError, match=r"found a \.txt file"):
            read_frames(folder.text("clip.txt", "x"))

    @pytest.mark.parametrize(
        "content",
        [b"", b"#EXTM3U\nhttp://example.com/a.ts\n", b"ffconcat version 1.0\n", b"\x89PNG"],
    )
    def test_playlists_and_other_files_are_not_given_to_ffmpeg(self, folder, content):
        with pytest.raises(InputError, match=r"expected a video .* that starts with"):
            read_frames(folder.text("clip.mp4", content))

    def test_damaged_video(self, folder):
        with pytest.raises(InputError, match="cannot be opened"):
            read_frames(folder.text("clip.mp4", bytes(4) + b"ftypisom" + bytes(100)))

    def test_cut_video_is_reported(self, video, caplog):
        source = open_frames(video)
        video.write_bytes(video.read_bytes()[:-600])
        frames = read_clip(source, FrameOptions()).frames
        assert 0 < len(frames) < 7
        assert "promises 7 frames" in caplog.text
