"""A closed mesh around the Gaussians at rest, within a budget of triangles, on the same skin."""

import numpy as np

from exporters.carrier import base_colors_linear
from exporters.clip import Clip
from exporters.errors import ClipError
from exporters.options import LEAST_FACES
from exporters.skinned_mesh import SkinnedMesh, normalized_influences
from exporters.surface.closing import closed, solid_pieces
from exporters.surface.ellipsoids import Ellipsoids, ellipsoids_of
from exporters.surface.grid import Grid
from exporters.surface.level import matching_level
from exporters.surface.nearby import look_at
from exporters.surface.pieces import near_others, object_length, without_strays

CELLS_ALONG = 256
"""Cells along the diagonal of the object: some ten triangles for each of the default budget."""

CELLS_PER_SIGMA = 8
"""Cells along the middle axis of a typical Gaussian that are enough, however few it leaves."""

FAINTEST = 0.02
"""Alpha below which a Gaussian adds nothing to the density.

With the 1/255 of renderers the tails of many faint Gaussians add up to a haze around the object.
"""

MOST_CELLS = 24_000_000
"""Bound of the memory: a few arrays of four bytes a cell live at once."""

BLUR_CELLS = 0.5
"""Blur that makes disks and needles as thick as a cell."""

REACH_CELLS = 2
"""How far the surface may lie from a thin disk that it is made of."""

CRUMB_CELLS = 8
"""A piece that is shorter, and than half of every real one, has come off in simplification."""

_WELL_USED, _ROUNDS = 0.97, 5  # share of the budget that ends the search for it


def control_mesh(clip: Clip, face_count: int) -> SkinnedMesh:
    """Return the mesh `surface`: closed, oriented outward, with colors and skin.

    It is the level set of the density of the Gaussians, at the level whose silhouettes match those
    of the drawn Gaussians best. Hollows are filled, pieces of too few Gaussians are left out.

    Args:
        clip: A valid clip; its rest pose counts.
        face_count: Most triangles, at least `LEAST_FACES`.

    Raises:
        ClipError: If the budget is too small for the shape, or all Gaussians are too faint.
    """
    if face_count < LEAST_FACES:
        raise ClipError(
            f"faces: expected at least {LEAST_FACES} triangles for a surface, got {face_count}"
        )
    ellipsoids = ellipsoids_of(clip.splats)
    seen = np.flatnonzero(ellipsoids.opacities > 2 * FAINTEST)
    if len(seen) == 0:
        raise ClipError(
            f"splats.opacities: the most opaque Gaussian has {ellipsoids.opacities.max():.3g}, too "
            "faint for a surface; are the opacities 0..1? Or write the mesh as quads"
        )
    seen = seen[near_others(ellipsoids.chosen(seen))]
    ellipsoids = ellipsoids.chosen(seen)
    grid = _grid_around(ellipsoids)
    positions, triangles = _surface(ellipsoids, grid, face_count)
    if len(triangles) == 0:
        raise ClipError(
            f"faces: nothing closed is left of the surface with {face_count} triangles; allow more, "
            "or write the mesh as quads"
        )
    normals = _normals(positions, triangles)
    blurred = ellipsoids.widened(BLUR_CELLS * grid.pitch)
    nearby = look_at(positions, normals, blurred, REACH_CELLS * grid.pitch)
    joint_ids, weights = nearby.blended_skin(clip.skin.joint_ids[seen], clip.skin.weights[seen])
    joint_ids, weights = normalized_influences(joint_ids, weights)
    colors = nearby.blend(base_colors_linear(clip.splats)[seen])
    return SkinnedMesh(
        name="surface",
        positions=positions.astype(np.float32),
        normals=normals.astype(np.float32),
        faces=triangles.astype(np.int32),
        colors_linear=np.clip(colors, 0, 1).astype(np.float32),
        opacities=np.ones(len(positions), np.float32),
        joint_ids=joint_ids,
        weights=weights,
        is_closed=True,
    )


def _surface(ellipsoids: Ellipsoids, grid: Grid, face_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and triangles of the closed level set, at most `face_count` of them."""
    from skimage.measure import marching_cubes

    field = grid.absorption(ellipsoids.widened(BLUR_CELLS * grid.pitch), FAINTEST)
    level = matching_level(field, ellipsoids, grid)
    field, shortest = without_strays(field, level, ellipsoids, grid)
    cells, triangles, _, _ = marching_cubes(
        np.pad(field, 1), level, gradient_direction="ascent", allow_degenerate=False
    )
    positions = (cells - 1) * grid.pitch + grid.origin
    crumb_length = min(CRUMB_CELLS * grid.pitch, shortest / 2)
    return _simplified(positions, triangles, face_count, crumb_length)


def _grid_around(ellipsoids: Ellipsoids) -> Grid:
    """Return a grid that holds where the Gaussians are seen, as fine as it makes sense."""
    variances = np.einsum("nii->ni", ellipsoids.covariances)
    reach = np.sqrt(2 * np.log(ellipsoids.opacities / FAINTEST))[:, None] * np.sqrt(variances)
    low = (ellipsoids.centers - reach).min(axis=0)
    high = (ellipsoids.centers + reach).max(axis=0)
    middle_variances = np.linalg.eigvalsh(ellipsoids.covariances)[:, 1]
    pitch = max(
        object_length(ellipsoids) / CELLS_ALONG,
        float(np.sqrt(np.median(middle_variances))) / CELLS_PER_SIGMA,
        float(np.cbrt(np.prod(high - low) / MOST_CELLS)),
    )
    shape = np.ceil((high - low) / pitch).astype(int) + 1
    return Grid(origin=low, pitch=pitch, shape=tuple(shape.tolist()))


def _simplified(
    positions: np.ndarray, triangles: np.ndarray, face_count: int, crumb_length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Collapse edges by quadric errors (Garland and Heckbert 1997) down to a budget; stay closed.

    Closing what simplification tore takes a few triangles more, and a wall of a hollow that came
    off leaves room for others, hence the rounds.
    """
    import fast_simplification

    positions, triangles = solid_pieces(*closed(positions, triangles), crumb_length)
    if len(triangles) <= face_count:
        return positions, triangles
    best = positions[:0], triangles[:0]
    target = face_count
    for _ in range(_ROUNDS):
        found = fast_simplification.simplify(
            positions.astype(np.float64), triangles.astype(np.int32), target_count=target
        )
        found = solid_pieces(*closed(*found), crumb_length)
        if len(best[1]) < len(found[1]) <= face_count:
            best = found
        if _WELL_USED * face_count <= len(found[1]) <= face_count:
            break
        # Aimed at the middle of what is well used; a torn mesh may have lost the wall of a hollow.
        share = face_count * (1 + _WELL_USED) / 2 / max(len(found[1]), 1)
        target = int(target * min(max(share, 0.5), 2.0))
    return best


def _normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the unit normals of the vertices, means of their faces' by angle, shape (V, 3)."""
    import trimesh

    normals = trimesh.Trimesh(positions, triangles, process=False).vertex_normals
    has_none = np.linalg.norm(normals, axis=1) < 0.5  # where all faces are slivers
    return np.where(has_none[:, None], [0.0, 0.0, 1.0], normals)
