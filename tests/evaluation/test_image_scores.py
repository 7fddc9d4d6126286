import cv2
import numpy as np
import pytest

from animator.evaluation.image_scores import (
    Picture,
    mean_scores,
    score_picture,
    structural_similarity,
)
from animator.evaluation.perceptual import load_judges


def picture(level: float, columns: slice) -> Picture:
    """A gray bar on black."""
    alpha = np.zeros((32, 40), np.float32)
    alpha[:, columns] = 1.0
    return Picture(rgb=np.repeat((level * alpha)[..., None], 3, axis=2), alpha=alpha)


def textures() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    first = cv2.GaussianBlur(rng.random((48, 64, 3)).astype(np.float32), (0, 0), 2.0)
    return first, (first + 0.05 * rng.random((48, 64, 3))).astype(np.float32)


def test_psnr_and_iou_of_bars():
    scores = score_picture(picture(0.5, slice(10, 30)), picture(0.6, slice(20, 40)), {})
    # Union 30 of 40 columns: .5, .1 and .6 off in 10 each.
    squared = (0.25 + 0.01 + 0.36) / 3
    assert scores.psnr_db == pytest.approx(-10 * np.log10(squared), abs=1e-4)
    assert scores.psnr_full_db == pytest.approx(-10 * np.log10(squared * 0.75), abs=1e-4)
    assert scores.iou == pytest.approx(1 / 3)
    assert np.isnan(scores.flip)
    assert np.isnan(scores.lpips)


def test_structural_similarity_is_that_of_its_formula():
    """Independent of scikit-image: the window as one OpenCV filter."""

    def blurred(image: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(
            image.astype(np.float64), (11, 11), 1.5, borderType=cv2.BORDER_REFLECT
        )

    first, second = textures()
    means = blurred(first), blurred(second)
    spread = blurred(first**2) - means[0] ** 2 + blurred(second**2) - means[1] ** 2
    shared = blurred(first * second) - means[0] * means[1]
    local = (2 * means[0] * means[1] + 1e-4) * (2 * shared + 9e-4)
    local /= (means[0] ** 2 + means[1] ** 2 + 1e-4) * (spread + 9e-4)
    assert structural_similarity(first, second) == pytest.approx(local.mean(), rel=1e-4)
    assert structural_similarity(first, first) == pytest.approx(1.0)


def test_flip_rises_with_the_difference():
    pytest.importorskip("flip_evaluator")
    first, second = textures()
    flip = load_judges()["flip"]
    assert flip(first, first) == 0.0
    assert 0 < flip(second, first) < flip(np.zeros_like(first), first) <= 1.0
    assert flip(np.zeros_like(first), np.zeros_like(first)) == 0.0


def test_flip_need_not_look_where_both_pictures_are_black():
    flip_evaluator = pytest.importorskip("flip_evaluator")
    first, second = (np.pad(image, ((60, 50), (40, 70), (0, 0))) for image in textures())
    whole = flip_evaluator.evaluate(first, second, "LDR", applyMagma=False)[1]
    assert load_judges()["flip"](second, first) == pytest.approx(whole, rel=1e-5)


def test_means_leave_out_what_could_not_be_measured():
    empty = Picture(rgb=np.zeros((32, 32, 3), np.float32), alpha=np.zeros((32, 32), np.float32))
    bar = picture(0.5, slice(0, 20))
    bar = Picture(rgb=bar.rgb[:, :32], alpha=bar.alpha[:, :32])
    nothing, something = score_picture(empty, empty, {}), score_picture(empty, bar, {})
    assert np.isnan(nothing.psnr_db)
    mean = mean_scores([nothing, something])
    assert mean.psnr_db == something.psnr_db
    assert mean.iou == 0.5
    assert np.isnan(mean_scores([]).ssim)
