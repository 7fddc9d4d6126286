import numpy as np
import pytest

from animator.errors import InputError
from animator.scene import find_masks
from animator.scene.border_background import object_mask
from animator.types import Frames

SIZE = (60, 80)


def disk(center=(30, 40), radius=15):
    y, x = np.mgrid[: SIZE[0], : SIZE[1]] + 0.5
    return (y - center[0]) ** 2 + (x - center[1]) ** 2 < radius**2


def picture(is_object, color=(200, 40, 40), background=(90, 110, 140), shading=0.0, noise=0.0):
    """Draw an object on a background that grows brighter towards the lower right."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]] / 60
    shade = shading * (x + y**2)[..., None]
    random = np.random.default_rng(0).normal(0, 1, (*SIZE, 3))
    image = np.where(is_object[..., None], color, np.array(background) + shade) + noise * random
    return np.clip(image, 0, 255).astype(np.uint8)


def clip(images, alphas=None, numbers=None):
    numbers = numbers or range(len(images))
    alphas = np.full((len(images), *SIZE), 255) if alphas is None else np.array(alphas)
    return Frames(
        images=np.stack(images),
        alphas=alphas.astype(np.uint8),
        numbers=tuple(numbers),
        names=tuple(f"f_{number:03d}.png" for number in numbers),
        fps=24.0,
    )


def overlap(mask, is_object):
    """Return intersection over union."""
    return ((mask > 127) & is_object).sum() / ((mask > 127) | is_object).sum()


PHOTO = np.random.default_rng(1).integers(0, 255, (*SIZE, 3)).astype(np.uint8)
PLAIN = picture(np.zeros(SIZE, bool))


class TestObjectMask:
    @pytest.mark.parametrize(("shading", "noise"), [(0, 0), (40, 0), (40, 3)])
    def test_disk_on_a_shaded_background(self, shading, noise):
        mask = object_mask(picture(disk(), shading=shading, noise=noise))
        assert mask.dtype == np.uint8
        assert overlap(mask, disk()) > 0.97

    def test_object_that_touches_the_border(self):
        is_object = disk(center=(50, 40), radius=20)
        assert overlap(object_mask(picture(is_object, shading=30)), is_object) > 0.95

    def test_large_images_get_a_mask_of_their_size(self):
        large = np.kron(picture(disk()), np.ones((10, 10, 1), np.uint8))
        mask = object_mask(large)
        assert mask.shape == (600, 800)
        assert overlap(mask, np.kron(disk(), np.ones((10, 10), bool))) > 0.95

    def test_the_same_image_gives_the_same_mask(self):
        image = picture(disk(), shading=40, noise=5)
        np.testing.assert_array_equal(object_mask(image), object_mask(image))

    @pytest.mark.parametrize("image", [PHOTO, PLAIN, PLAIN[:3, :3]], ids=["photo", "empty", "tiny"])
    def test_gives_up_instead_of_guessing(self, image):
        assert object_mask(image) is None


class TestAlpha:
    def test_wins_over_everything_found(self, folder):
        folder.image("masks/f_000.png", np.zeros(SIZE, np.uint8))
        alphas = [np.where(disk(), 255, 0)]
        masks = find_masks(clip([PHOTO], alphas), folder.root / "masks")
        assert masks.origin == "alpha"
        np.testing.assert_array_equal(masks.alphas, alphas)

    def test_odd_frames_are_reported(self, caplog):
        alphas = [np.where(disk(), 255, 0), np.full(SIZE, 255), np.zeros(SIZE)]
        find_masks(clip([PHOTO] * 3, alphas, numbers=[4, 5, 9]))
        assert "1 of 3 frames are opaque all over, unlike the others (5)" in caplog.text
        assert "1 of 3 frames are wholly transparent: nothing to see there (9)" in caplog.text


class TestFiles:
    @pytest.mark.parametrize(
        "names",
        [("f_000.bmp", "f_001.png"), ("f_000.png.png", "f_001.png.png"), ("0.png", "1.png")],
    )
    def test_matched_by_name_or_number(self, folder, names):
        coverages = [np.where(disk(), 255, 0).astype(np.uint8), np.full(SIZE, 128, np.uint8)]
        for name, coverage in zip(names, coverages, strict=True):
            folder.image(f"masks/{name}", coverage)
        masks = find_masks(clip([PHOTO] * 2), folder.root / "masks")
        assert masks.origin == "files"
        assert "2 files from" in masks.note
        np.testing.assert_array_equal(masks.alphas, coverages)

    def test_named_folder_wins_over_alpha(self, folder):
        folder.image("m/f_000.png", np.where(disk(), 255, 0).astype(np.uint8))
        frames = clip([PHOTO], [np.full(SIZE, 7)])
        masks = find_masks(frames, folder.root / "m", is_folder_explicit=True)
        np.testing.assert_array_equal(masks.alphas[0], np.where(disk(), 255, 0))

    def test_coverage_in_the_masks_own_alpha(self, folder):
        rgba = np.full((*SIZE, 4), 255, np.uint8)
        rgba[..., 3] = 33
        folder.image("masks/f_000.png", rgba)
        assert (find_masks(clip([PHOTO]), folder.root / "masks").alphas == 33).all()

    def test_zeros_and_ones_mean_full_coverage(self, folder, caplog):
        folder.image("masks/f_000.png", disk().astype(np.uint8))
        masks = find_masks(clip([PHOTO]), folder.root / "masks")
        np.testing.assert_array_equal(masks.alphas[0], np.where(disk(), 255, 0))
        assert "hold 0 and 1" in caplog.text

    def test_larger_masks_of_the_same_shape_are_averaged_down(self, folder):
        fine = np.zeros((SIZE[0] * 2, SIZE[1] * 2), np.uint8)
        fine[::2] = 200
        folder.image("masks/f_000.png", fine)
        assert (find_masks(clip([PHOTO]), folder.root / "masks").alphas == 100).all()

    def test_other_shape_is_refused(self, folder):
        folder.image("masks/f_000.png", np.zeros((80, 60), np.uint8))
        with pytest.raises(InputError, match=r"f_000.png: the mask has 60x80 .* has 80x60"):
            find_masks(clip([PHOTO]), folder.root / "masks")

    def test_missing_masks_are_named(self, folder):
        folder.image("masks/f_000.png", np.zeros(SIZE, np.uint8))
        with pytest.raises(InputError, match=r"3 frames, found none for 2: f_001.png, f_002.png;"):
            find_masks(clip([PHOTO] * 3), folder.root / "masks")

    def test_unrelated_folder_is_left_alone_unless_named(self, folder, caplog):
        folder.image("masks/capture_77.png", np.zeros(SIZE, np.uint8))
        masks = find_masks(clip([picture(disk())]), folder.root / "masks")
        assert masks.origin == "automatic"
        assert "none of its masks has the name or number of a frame" in caplog.text
        with pytest.raises(InputError, match="expected a mask for each of the 1 frames"):
            find_masks(clip([PHOTO]), folder.root / "masks", is_folder_explicit=True)


class TestAutomatic:
    def test_each_frame_has_its_own(self):
        places = [disk((25, 30)), disk((35, 50))]
        masks = find_masks(clip([picture(place) for place in places]))
        assert masks.origin == "automatic"
        assert all(overlap(*pair) > 0.95 for pair in zip(masks.alphas, places, strict=True))
        assert "in 2 of 2 frames" in masks.note

    def test_frames_without_plain_background_are_used_whole(self, caplog):
        masks = find_masks(clip([picture(disk()), PHOTO], numbers=[3, 8]))
        assert masks.origin == "automatic"
        assert (masks.alphas[1] == 255).all()
        assert "1 of 2 frames show no plain background" in caplog.text
        assert caplog.text.rstrip().endswith("(8).")

    def test_nothing_found_at_all(self, caplog):
        masks = find_masks(clip([PHOTO]))
        assert masks.origin == "none"
        assert (masks.alphas == 255).all()
        assert "--masks FOLDER" in caplog.text
