"""Vertex colors as a texture, for tools that know no vertex colors (Quick Look).

Each triangle owns a block of two by two texels, and its corners lie on three of their centers. With
the fourth texel at b + c - a, what a bilinear filter reads between them is exactly the color that
vertex colors a, b, c would give: (1-u-v) a + u b + v c.
"""

import dataclasses

import numpy as np

from exporters.skinned_mesh import SkinnedMesh

_BLOCK = 2


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class VertexTexture:
    """The colors of F triangles."""

    pixels: np.ndarray
    """sRGB, first row on top, uint8, shape (S, S, 3), S a power of two."""
    uvs: np.ndarray
    """Place of each triangle corner, (0, 0) at the lower left, float32, shape (F, 3, 2)."""


def vertex_texture(mesh: SkinnedMesh) -> VertexTexture:
    """Lay out the colors of a mesh's triangles."""
    first, second, third = np.moveaxis(mesh.colors_linear[mesh.triangles], 1, 0)
    across = np.clip(second + third - first, 0.0, 1.0)
    blocks = np.stack([first, second, third, across], axis=1).reshape(-1, _BLOCK, _BLOCK, 3)
    count = len(blocks)
    blocks_per_side = 1 << max(int(np.ceil(np.log2(max(count, 1)) / 2)), 0)
    grid = np.zeros((blocks_per_side**2, _BLOCK, _BLOCK, 3), np.float32)
    grid[:count] = blocks
    side = _BLOCK * blocks_per_side
    image = grid.reshape(blocks_per_side, blocks_per_side, _BLOCK, _BLOCK, 3).swapaxes(1, 2)
    rows, columns = np.divmod(np.arange(count), blocks_per_side)
    corners = np.array([[0, 0], [1, 0], [0, 1]])
    texels = _BLOCK * np.stack([columns, rows], axis=1)[:, None] + corners + 0.5
    uvs = texels / side
    uvs[..., 1] = 1.0 - uvs[..., 1]
    return VertexTexture(
        pixels=_srgb_bytes(image.reshape(side, side, 3)), uvs=uvs.astype(np.float32)
    )


def _srgb_bytes(linear: np.ndarray) -> np.ndarray:
    """Encode linear colors 0..1 (IEC 61966-2-1), to the nearest of 256 steps."""
    exact = linear.astype(np.float64)
    srgb = np.where(exact <= 0.0031308, 12.92 * exact, 1.055 * exact ** (1 / 2.4) - 0.055)
    return np.rint(255 * srgb).astype(np.uint8)
