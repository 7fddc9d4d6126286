"""The quad geometry that USD and glTF share."""

import numpy as np

from exporters.carrier import HALF_SIZE_SIGMAS, base_colors_linear, carrier_quads
from exporters.clip import Skin, Splats
from tests.helpers import clips

SH_C0 = 0.5 / np.sqrt(np.pi)


def one_splat(**changes: object) -> Splats:
    fields: dict = {
        "positions": [[1.0, 2.0, 3.0]],
        "quats_wxyz": [[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]],  # +90 degrees about z: x to y
        "scales": [[0.1, 0.01, 0.2]],
        "opacities": [0.25],
        "sh_coeffs": np.zeros((1, 1, 3)),
    }
    return Splats(**{**fields, **changes})


def test_quad_spans_the_two_largest_axes() -> None:
    # The largest axis is z (0.2), then the local x (0.1), which points along world y.
    long, short = 0.2 * HALF_SIZE_SIGMAS, 0.1 * HALF_SIZE_SIGMAS
    expected = np.array([1.0, 2.0, 3.0]) + np.array(
        [[0, -short, -long], [0, -short, long], [0, short, long], [0, short, -long]]
    )
    np.testing.assert_allclose(
        carrier_quads(one_splat(), clips.skin_to([0])).positions, expected, atol=1e-6
    )


def test_normals_agree_with_the_winding_of_both_triangles() -> None:
    rng = np.random.default_rng(0)
    quats_wxyz = rng.normal(size=(20, 4))
    mesh = carrier_quads(
        Splats(
            positions=rng.normal(size=(20, 3)),
            quats_wxyz=quats_wxyz / np.linalg.norm(quats_wxyz, axis=1, keepdims=True),
            scales=rng.uniform(0.1, 0.2, (20, 3)),
            opacities=np.full(20, 0.5),
            sh_coeffs=np.zeros((20, 1, 3)),
        ),
        clips.skin_to([0] * 20),
    )
    corners = mesh.positions[mesh.triangles].astype(np.float64)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    np.testing.assert_allclose(faces, mesh.normals[mesh.triangles[:, 0]], atol=1e-4)


def test_mean_of_the_vertices_is_the_center() -> None:
    mean = carrier_quads(one_splat(), clips.skin_to([0])).positions.mean(axis=0)
    np.testing.assert_allclose(mean, [1, 2, 3], atol=1e-6)


def test_equal_scales_choose_the_first_axes() -> None:
    ball = one_splat(quats_wxyz=[[1.0, 0.0, 0.0, 0.0]], scales=[[0.1, 0.1, 0.1]])
    mesh = carrier_quads(ball, clips.skin_to([0]))
    np.testing.assert_allclose(mesh.normals[0], [0.0, 0.0, 1.0], atol=1e-6)


def test_colors_are_decoded_from_srgb_and_clipped() -> None:
    srgb = np.array([0.5, 0.02, 1.5])
    splat = one_splat(sh_coeffs=((srgb - 0.5) / SH_C0)[None, None])
    # Mid gray by the table of IEC 61966-2-1; the dark end is linear, 1 / 12.92.
    np.testing.assert_allclose(
        base_colors_linear(splat)[0], [0.21404114, 0.02 / 12.92, 1.0], rtol=1e-4
    )


def test_unused_influences_name_joint_zero_and_weights_sum_to_one() -> None:
    skin = Skin(joint_ids=[[3, 1, 2, 2]], weights=[[0.25, 0.5, 0.0, 0.0]])
    mesh = carrier_quads(one_splat(), skin)
    np.testing.assert_array_equal(mesh.joint_ids, [[3, 1, 0, 0]] * 4)
    np.testing.assert_allclose(mesh.weights, [[1 / 3, 2 / 3, 0, 0]] * 4, rtol=1e-7)
