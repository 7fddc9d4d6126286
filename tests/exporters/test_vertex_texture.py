import dataclasses

import numpy as np
import pytest
import scipy.ndimage

from exporters.carrier import carrier_quads
from exporters.skinned_mesh import SkinnedMesh
from exporters.vertex_texture import vertex_texture
from tests.helpers import clips


def colored(count: int) -> SkinnedMesh:
    """Return triangles of mild colors, so that no block leaves 0..1 at its fourth texel."""
    clip = clips.random(gaussians=count)
    quads = carrier_quads(clip.splats, clip.skin)
    colors = np.random.default_rng(3).uniform(0.35, 0.65, quads.colors_linear.shape)
    return dataclasses.replace(quads, colors_linear=colors.astype(np.float32))


def linear(srgb: np.ndarray) -> np.ndarray:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("count", [1, 2, 9])
def test_a_bilinear_filter_reads_what_vertex_colors_would_give(count):
    mesh = colored(count)
    texture = vertex_texture(mesh)
    side = len(texture.pixels)
    decoded = linear(texture.pixels / 255.0)
    rng = np.random.default_rng(5)
    weights = rng.dirichlet(np.ones(3), (len(mesh.triangles), 20))
    uvs = np.einsum("fpc,fcx->fpx", weights, texture.uvs.astype(np.float64))
    # Texel (row, column) has its center at (+0.5, +0.5); v counts from below.
    rows, columns = (1 - uvs[..., 1]) * side - 0.5, uvs[..., 0] * side - 0.5
    for channel in range(3):
        found = scipy.ndimage.map_coordinates(decoded[..., channel], [rows, columns], order=1)
        corners = mesh.colors_linear[mesh.triangles][..., channel]
        # Each texel is rounded to 1/255 of sRGB, whose slope is 2.3 at most.
        expected = np.einsum("fpc,fc->fp", weights, corners)
        np.testing.assert_allclose(found, expected, atol=3 * 2.3 / 510)


def test_sides_are_the_smallest_power_of_two_that_holds_all_triangles():
    sides = {len(vertex_texture(colored(count)).pixels) for count in (8,)}  # 16 triangles
    assert sides == {8}
    assert len(vertex_texture(colored(9)).pixels) == 16  # 18 triangles need 5 blocks a side, so 8


def test_no_two_triangles_share_a_texel():
    texture = vertex_texture(colored(30))
    texels = np.floor(texture.uvs * len(texture.pixels)).astype(int).reshape(-1, 2)
    assert len(np.unique(texels, axis=0)) == len(texels)
