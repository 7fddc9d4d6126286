"""What belongs to the object: Gaussians and cells in pieces of some weight, not strays."""

import numpy as np

from exporters.surface.ellipsoids import Ellipsoids
from exporters.surface.grid import Grid

LEAST_SHARE = 0.001
"""A piece that has less of the opacity of all Gaussians is a stray, however solid it looks."""

_LEAST_GAUSSIANS = 4  # ... or fewer than that many, where a share of the whole means nothing
_LEAST_OF_LARGEST = 0.05  # ... which in turn means nothing where all pieces are that small

LEAK_CELLS = 2
"""Openings up to twice as wide are leaks: the chamber behind them is solid."""

_NEIGHBOR_SHARE, _NEIGHBOR_SIGMAS = 0.05, 4.0
"""Gaussians within this share of the object's length, or so many typical sigmas, are neighbors."""

_SOLID_OPACITY = 0.1  # the size of the object is that of the Gaussians above, if there are any


def object_length(ellipsoids: Ellipsoids) -> float:
    """Return the diagonal of the box around almost all solid Gaussians, at one sigma."""
    is_solid = ellipsoids.opacities >= min(_SOLID_OPACITY, ellipsoids.opacities.max())
    solid = ellipsoids.chosen(is_solid)
    half_widths = np.sqrt(np.einsum("nii->ni", solid.covariances))
    low = np.percentile(solid.centers - half_widths, 0.5, axis=0)
    high = np.percentile(solid.centers + half_widths, 99.5, axis=0)
    return float(np.linalg.norm(high - low))


def near_others(ellipsoids: Ellipsoids) -> np.ndarray:
    """Return which Gaussians lie in a cluster that is worth a grid, bool, shape (N,).

    A few strays far away would otherwise make the grid so wide that nothing is seen in it.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    sigmas = np.sqrt(np.einsum("nii->ni", ellipsoids.covariances).max(axis=1))
    cell = max(
        _NEIGHBOR_SHARE * object_length(ellipsoids), _NEIGHBOR_SIGMAS * float(np.median(sigmas))
    )
    lattice, owners = np.unique(
        np.floor(ellipsoids.centers / cell).astype(np.int64), axis=0, return_inverse=True
    )
    pairs = KDTree(lattice).query_pairs(1.8, output_type="ndarray")  # the 26 neighbors
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(lattice), len(lattice)))
    _, cluster_of_cell = connected_components(links, directed=False)
    cluster = cluster_of_cell[owners.reshape(-1)]
    masses = np.bincount(cluster, weights=ellipsoids.opacities)
    return _is_real(masses, ellipsoids)[cluster]


def without_strays(
    field: np.ndarray, level: float, ellipsoids: Ellipsoids, grid: Grid
) -> tuple[np.ndarray, float]:
    """Fill hollows and empty stray pieces.

    Args:
        field: Absorption in the cells, float32.
        level: Where the surface lies.
        ellipsoids: The Gaussians that made it.
        grid: The cells.

    Returns:
        The new field, and the diagonal of the smallest box around a piece that stays [scene unit].
    """
    from scipy import ndimage
    from skimage import measure

    field = np.where(_is_hollow(field < level), np.float32(2 * level), field)
    piece = np.asarray(measure.label(field >= level, connectivity=3))
    holder = piece[grid.nearest(ellipsoids.centers)]
    masses = np.bincount(
        holder, weights=ellipsoids.opacities * (holder > 0), minlength=int(piece.max()) + 1
    )
    is_kept = _is_real(masses, ellipsoids)
    sizes = [
        [side.stop - side.start for side in box]
        for box, is_real in zip(ndimage.find_objects(piece), is_kept[1:], strict=True)
        if is_real
    ]
    is_kept[0] = True  # what lies outside stays as it is, for the surface to lie between cells
    shortest = float(np.linalg.norm(sizes, axis=1).min()) * grid.pitch
    return np.where(is_kept[piece], field, np.float32(0)), shortest


def _is_hollow(is_empty: np.ndarray) -> np.ndarray:
    """Tell chambers inside the object, open to the outside by leaks at most, from what is outside.

    Trained models are shells with pinholes; behind them lies what no camera saw.
    """
    from scipy import ndimage
    from skimage import measure

    # A ring of empty cells makes everything outside one piece.
    is_empty = np.pad(is_empty, LEAK_CELLS + 1, constant_values=True)
    is_wide = ndimage.binary_erosion(is_empty, iterations=LEAK_CELLS, border_value=1)
    chambers = np.zeros(is_empty.shape, bool)
    for spaces in (is_empty, is_wide):
        space = np.asarray(measure.label(spaces, connectivity=1))
        chambers |= (space > 0) & (space != space[0, 0, 0])
    chambers = ndimage.binary_dilation(chambers, iterations=LEAK_CELLS, mask=is_empty)
    inner = (slice(LEAK_CELLS + 1, -LEAK_CELLS - 1),) * 3
    return chambers[inner]


def _is_real(masses: np.ndarray, ellipsoids: Ellipsoids) -> np.ndarray:
    """Tell pieces of the object from strays by the opacities of their Gaussians."""
    total = ellipsoids.opacities.sum()
    few = _LEAST_GAUSSIANS * total / len(ellipsoids)
    least = max(LEAST_SHARE * total, min(few, _LEAST_OF_LARGEST * masses.max()))
    return masses >= least
