import dataclasses

import numpy as np
import pytest

from exporters import harmonics
from exporters.coordinates import Y_UP_FROM_Z_UP, to_y_up_meters
from tests.helpers import clips


def z_up(clip):
    return dataclasses.replace(clip, up_axis="Z", meters_per_unit=0.01)


def test_hinge_in_y_up_meters_by_hand():
    converted = to_y_up_meters(clips.z_up_centimeters())
    assert (converted.up_axis, converted.meters_per_unit) == ("Y", 1.0)
    np.testing.assert_allclose(converted.splats.positions[1], [0.02, 0, 0], atol=1e-9)
    np.testing.assert_allclose(converted.pose_at(1.0).positions[1], [0.01, 0, -0.01], atol=1e-9)
    np.testing.assert_allclose(converted.splats.scales[0], [3e-4, 2e-4, 1e-4], rtol=1e-6)


def test_conversion_commutes_with_posing():
    clip = z_up(clips.random())
    converted = to_y_up_meters(clip)
    converted.validate()
    for time_s in (0.0, 0.13):
        before, after = clip.pose_at(time_s), converted.pose_at(time_s)
        np.testing.assert_allclose(
            after.positions, 0.01 * before.positions @ Y_UP_FROM_Z_UP.T, atol=1e-7
        )
        quarter = (np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0)  # -90 degrees about x
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_quat(quarter, scalar_first=True) * Rotation.from_quat(
            before.quats_wxyz, scalar_first=True
        )
        cosines = np.sum(turned.as_quat(scalar_first=True) * after.quats_wxyz, axis=1)
        np.testing.assert_allclose(np.abs(cosines), 1.0, atol=1e-6)


def test_the_camera_sees_the_same_pixels():
    clip = z_up(clips.chain())
    converted = to_y_up_meters(clip)
    for key in range(3):
        before, after = (
            np.append(c.splats.positions[2].astype(float), 1.0) @ c.camera.cam_from_world[key].T
            for c in (clip, converted)
        )
        np.testing.assert_allclose(after[:3] / after[2], before[:3] / before[2], atol=1e-6)
        assert after[2] == pytest.approx(0.01 * before[2])


def test_nothing_to_do_changes_nothing():
    clip = clips.hinge()
    assert to_y_up_meters(clip) is clip


def test_harmonics_are_the_published_ones():
    # Constants of the reference renderer (Kerbl et al. 2023), at a direction symmetric in nothing.
    x, y, z = direction = np.array([0.48, 0.6, 0.64])
    published = [
        0.28209479177387814,
        -0.4886025119029199 * y,
        0.4886025119029199 * z,
        -0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        -1.0925484305920792 * y * z,
        0.31539156525252005 * (2 * z * z - x * x - y * y),
        -1.0925484305920792 * x * z,
        0.5462742152960396 * (x * x - y * y),
        -0.5900435899266435 * y * (3 * x * x - y * y),
        2.890611442640554 * x * y * z,
        -0.4570457994644658 * y * (4 * z * z - x * x - y * y),
        0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y),
        -0.4570457994644658 * x * (4 * z * z - x * x - y * y),
        1.445305721320277 * z * (x * x - y * y),
        -0.5900435899266435 * x * (x * x - 3 * y * y),
    ]
    np.testing.assert_allclose(harmonics.basis(direction[None])[0], published, rtol=1e-12)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_turned_harmonics_show_the_old_color_in_the_turned_direction(degree):
    rng = np.random.default_rng(5)
    sh_coeffs = rng.normal(size=(4, (degree + 1) ** 2, 3))
    turned = harmonics.rotate(sh_coeffs, Y_UP_FROM_Z_UP)
    directions = rng.normal(size=(7, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    count = sh_coeffs.shape[1]
    old = np.einsum("dk,nkc->ndc", harmonics.basis(directions)[:, :count], sh_coeffs)
    turned_directions = directions @ Y_UP_FROM_Z_UP.T
    new = np.einsum("dk,nkc->ndc", harmonics.basis(turned_directions)[:, :count], turned)
    np.testing.assert_allclose(new, old, atol=1e-12)
