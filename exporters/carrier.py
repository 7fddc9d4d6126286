"""The mesh that carries the skin: one oriented quad a Gaussian, the same in every format.

Neither USD nor glTF defines skinning of splats, but every tool skins a mesh. Quad i has the
vertices 4i .. 4i+3, all four bound like Gaussian i: their mean is the Gaussian's center in every
pose, and their edges follow the rotation (and the shear) that linear blend skinning gives there.
"""

import numpy as np

from exporters import quaternions
from exporters.clip import Skin, Splats
from exporters.skinned_mesh import SkinnedMesh, normalized_influences

HALF_SIZE_SIGMAS = 2.0
"""Half the side of a quad, in standard deviations along each axis.

Drawn as opaque quads, three test models came nearest to their photographs between 2.0 and 2.4
(26.0, 29.7 and 31.2 dB at 2.0; 2 to 3.5 dB less at 1.25); at 3.0 quads begin to hide others.
"""

VERTICES_PER_SPLAT = 4

SH_C0 = 0.28209479177387814  # Y_0^0 = 1 / (2 sqrt(pi))

# Counter-clockwise as seen from the tip of the normal, in half sides along the two quad axes.
_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=np.float32)


def carrier_quads(splats: Splats, skin: Skin) -> SkinnedMesh:
    """Span one quad a Gaussian by its two largest axes.

    Args:
        splats: The Gaussians at rest, N of them.
        skin: Their joints and weights.

    Returns:
        The mesh `carrier`: quad i for Gaussian i, sides of `2 * HALF_SIZE_SIGMAS` sigmas.
    """
    count = len(splats)
    axes = quaternions.to_matrices(splats.quats_wxyz)
    # Stable, so that equal scales choose the same axes on every machine.
    order = np.argsort(-splats.scales, axis=1, kind="stable")
    rows = np.arange(count)
    first = axes[rows, :, order[:, 0]]
    second = axes[rows, :, order[:, 1]]
    sides = np.stack(
        [
            first * splats.scales[rows, order[:, 0], None],
            second * splats.scales[rows, order[:, 1], None],
        ],
        axis=1,
    )
    offsets = np.float32(HALF_SIZE_SIGMAS) * np.einsum("ca,nax->ncx", _CORNERS, sides)
    vertices = splats.positions[:, None, :] + offsets
    indices = np.arange(VERTICES_PER_SPLAT * count, dtype=np.int32)
    joint_ids, weights = normalized_influences(skin.joint_ids, skin.weights)
    return SkinnedMesh(
        name="carrier",
        positions=np.ascontiguousarray(vertices.reshape(-1, 3), dtype=np.float32),
        normals=_per_vertex(np.cross(first, second).astype(np.float32)),
        faces=indices.reshape(-1, VERTICES_PER_SPLAT),
        colors_linear=_per_vertex(base_colors_linear(splats)),
        opacities=_per_vertex(splats.opacities),
        joint_ids=_per_vertex(joint_ids),
        weights=_per_vertex(weights),
        is_closed=False,
    )


def _per_vertex(per_splat: np.ndarray) -> np.ndarray:
    """Repeat one row a Gaussian for the four vertices of its quad, (N, ...) to (4N, ...)."""
    return np.repeat(per_splat, VERTICES_PER_SPLAT, axis=0)


def base_colors_linear(splats: Splats) -> np.ndarray:
    """Return the direction-independent color of each Gaussian, linear Rec. 709 0..1, shape (N, 3).

    Splats are trained on sRGB images, so that 0.5 + C0 * sh_0 is an sRGB value (the fallback color
    that KHR_gaussian_splatting prescribes); mesh colors are linear in glTF and in USD, hence the
    decoding of IEC 61966-2-1.
    """
    # In float64, so that every processor rounds the power to the same float32.
    constant = splats.sh_coeffs[:, 0, :].astype(np.float64)
    srgb = np.clip(0.5 + SH_C0 * constant, 0.0, 1.0)
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)
