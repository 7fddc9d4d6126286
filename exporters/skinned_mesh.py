"""A mesh that follows the joints of a clip: what both formats write, whatever it was made from."""

import dataclasses

import numpy as np

INFLUENCES = 4
"""Joints a vertex: what every engine takes in one set of attributes."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SkinnedMesh:
    """A mesh in the rest pose with colors and a skin; V vertices, F faces."""

    name: str
    """Lower-case name among the meshes of an asset; becomes a node, or capitalized a prim."""
    positions: np.ndarray
    """Vertices [scene unit], float32, shape (V, 3)."""
    normals: np.ndarray
    """Unit normals, float32, shape (V, 3)."""
    faces: np.ndarray
    """Vertex indices, counter-clockwise seen from outside, int32, shape (F, 3) or (F, 4)."""
    colors_linear: np.ndarray
    """Linear Rec. 709 colors 0..1, float32, shape (V, 3)."""
    opacities: np.ndarray
    """Opacities 0..1, float32, shape (V,)."""
    joint_ids: np.ndarray
    """Joints of each vertex, no used one twice, unused ones joint 0, int32, shape (V, 4)."""
    weights: np.ndarray
    """Weights >= 0, rows sum to 1 in float32 precision, float32, shape (V, 4)."""
    is_closed: bool
    """Whether the mesh is an opaque surface around a volume, so that its inside is never seen."""

    @property
    def triangles(self) -> np.ndarray:
        """The faces, quads cut along the diagonal 0-2, int32, shape (F or 2F, 3)."""
        if self.faces.shape[1] == 3:
            return self.faces
        return self.faces[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def normalized_influences(
    joint_ids: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Let weights sum to 1 and unused influences name joint 0, as both formats ask.

    A tool that does not normalize weights would otherwise differ from one that does; glTF's
    validator warns of joints that carry no weight.

    Args:
        joint_ids: Joints, shape (V, 4).
        weights: Weights >= 0, not all of a row 0, shape (V, 4).

    Returns:
        Joints, int32, and weights, float32, both of shape (V, 4).
    """
    exact = weights / weights.sum(axis=1, keepdims=True, dtype=np.float64)
    return np.where(exact > 0, joint_ids, 0).astype(np.int32), exact.astype(np.float32)
