import numpy as np
import pytest

from animator.render.cpu import CpuRenderer
from animator.sequence.target import FrameView, Window, halved
from tests.helpers.objects import front_camera
from tests.helpers.textured import draw, filmed, textured_box

CAMERA = front_camera(3.0, size_px=96)
RENDERER = CpuRenderer()


def test_a_halved_camera_sees_everything_at_half_its_place():
    points = np.random.default_rng(0).uniform(-0.7, 0.7, (20, 3))
    whole_px, depths = CAMERA.project(points)
    half_px, same_depths = CAMERA.halved().project(points)
    np.testing.assert_allclose(half_px, whole_px / 2)
    np.testing.assert_array_equal(same_depths, depths)


@pytest.mark.parametrize(("width", "height"), [(96, 64), (95, 63)])
def test_a_halved_frame_is_what_its_camera_sees(width, height):
    box = textured_box()
    frames = filmed([draw(RENDERER, box, CAMERA)])
    window = Window(left=0, top=16, width=width, height=height)
    whole = FrameView.read(frames, 0).target(window, CAMERA, RENDERER.device)
    half = halved(whole)
    assert half.image.alpha.shape == (half.camera.height_px, half.camera.width_px)
    assert half.image.rgb.shape == (height // 2, width // 2, 3)
    assert half.object_px == whole.object_px / 2
    mean = whole.image.rgb[:2, :2].mean(dim=(0, 1))
    np.testing.assert_allclose(half.image.rgb[0, 0], mean, atol=1e-6)
    # Small pictures are drawn softer; what must agree is the place, to a tenth of a pixel.
    drawn = RENDERER.render(box, half.camera)
    np.testing.assert_allclose(middle_px(drawn.alpha), middle_px(half.image.alpha), atol=0.1)


def middle_px(alpha) -> np.ndarray:
    rows, columns = np.indices(alpha.shape) + 0.5
    weights = np.asarray(alpha)
    return np.array([np.average(columns, weights=weights), np.average(rows, weights=weights)])
