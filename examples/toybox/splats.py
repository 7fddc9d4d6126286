"""Cover painted surfaces with Gaussians."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from toybox.surfaces import Patch

_CANDIDATES_PER_GAUSSIAN = 24
_ROUNDS = 8
_COLOR_REACH = 1.2
"""Distance, in spacings, that a full step in one color channel counts as: edges of the paint become
edges between Gaussians."""
_FILL = 1.9
"""Standard deviation over that of the cell: neighbors overlap enough to leave no gaps."""
_THICKNESS = 0.1
"""Standard deviation across the surface [spacing]."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceSplats:
    """Gaussians lying in surfaces, unlit, each of one rigid part."""

    positions: np.ndarray
    """Centers [scene unit], shape (N, 3)."""
    normals: np.ndarray
    """Outward unit normals, shape (N, 3)."""
    axes: np.ndarray
    """Principal axes as columns, proper rotations, shape (N, 3, 3)."""
    scales: np.ndarray
    """Standard deviations along the axes [scene unit], shape (N, 3)."""
    albedos: np.ndarray
    """sRGB of the paint 0..1, shape (N, 3)."""
    glows: np.ndarray
    """Share of the color that no shadow touches, shape (N,)."""
    part_ids: np.ndarray
    """Rigid part of each, int64, shape (N,)."""

    def __len__(self) -> int:
        return len(self.positions)

    def posed(self, world_from_part: np.ndarray) -> "SurfaceSplats":
        """Move every part.

        Args:
            world_from_part: Rigid transforms, shape (P, 4, 4).
        """
        rotations = world_from_part[self.part_ids, :3, :3]
        offsets = world_from_part[self.part_ids, :3, 3]
        return dataclasses.replace(
            self,
            positions=np.einsum("nij,nj->ni", rotations, self.positions) + offsets,
            normals=np.einsum("nij,nj->ni", rotations, self.normals),
            axes=rotations @ self.axes,
        )


def cover(
    patches_by_part: Sequence[Sequence[Patch]], count: int, rng: np.random.Generator
) -> SurfaceSplats:
    """Cover all patches with about `count` Gaussians, in the parts' own frames."""
    wanted_area = sum(p.shape.area * p.detail for patches in patches_by_part for p in patches)
    pieces = [
        _cover_patch(patch, part_id, count * patch.shape.area * patch.detail / wanted_area, rng)
        for part_id, patches in enumerate(patches_by_part)
        for patch in patches
    ]
    fields = [field.name for field in dataclasses.fields(SurfaceSplats)]
    return SurfaceSplats(
        **{name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in fields}
    )


def _cover_patch(
    patch: Patch, part_id: int, share: float, rng: np.random.Generator
) -> SurfaceSplats:
    """Divide a patch into cells of similar size and color; each becomes one Gaussian."""
    count = max(4, round(share))
    spacing = np.sqrt(patch.shape.area / count)
    points = patch.shape.at(rng.random((_CANDIDATES_PER_GAUSSIAN * count, 2)))
    colors = patch.pattern(points.surface_xy)
    features = np.concatenate([points.positions / spacing, _COLOR_REACH * colors], axis=1)
    cells = _cells(features, count, rng)
    sizes = np.bincount(cells, minlength=count)
    kept = np.flatnonzero(sizes >= 4)

    def mean(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(len(values), -1)
        sums = np.stack([np.bincount(cells, column, count) for column in flat.T], axis=1)
        return (sums[kept] / sizes[kept, None]).reshape(len(kept), *values.shape[1:])

    normals = mean(points.normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    squares = mean(points.positions[:, :, None] * points.positions[:, None, :])
    centers = mean(points.positions)
    covariances = squares - centers[:, :, None] * centers[:, None, :]
    variances, axes = np.linalg.eigh(covariances)
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]
    return SurfaceSplats(
        positions=centers,
        normals=normals,
        axes=axes,
        scales=np.maximum(_FILL * np.sqrt(np.maximum(variances, 0.0)), _THICKNESS * spacing),
        albedos=mean(colors),
        glows=np.full(len(kept), patch.glow),
        part_ids=np.full(len(kept), part_id),
    )


def _cells(features: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return the cell of each candidate: k-means (Lloyd 1982) on place and color."""
    centers = features[rng.choice(len(features), count, replace=False)]
    cells = np.zeros(len(features), np.int64)
    for _ in range(_ROUNDS):
        cells = cKDTree(centers).query(features)[1]
        sizes = np.bincount(cells, minlength=count)
        sums = np.stack([np.bincount(cells, column, count) for column in features.T], axis=1)
        is_used = sizes > 0
        centers[is_used] = sums[is_used] / sizes[is_used, None]
    return cells
