"""Locally affine motion: which matches agree with their neighbours, and what lies between."""

import numpy as np
from scipy.spatial import KDTree

AFFINE_REACH_PX = 30.0
"""Unit of the affine fit [px]: farther matches count mostly for the linear part."""
CHUNK = 8192
"""Fits solved at once; bounds memory to a few MB for any number of matches and pixels."""

# Pulls the linear part to the identity where neighbors are collinear; too weak to fight rotations.
_RIDGE = np.diag([0.01, 0.01, 1e-6])
_RESIDUAL_SCALE_PX = 3.0
_MIN_SUPPORT_SHARE = 0.4


def _fit_affine(
    source: np.ndarray, target: np.ndarray, weights: np.ndarray, *, iterations: int
) -> tuple[np.ndarray, np.ndarray]:
    """Fit target = A source + b in B neighbourhoods by reweighted least squares (Cauchy).

    Args:
        source: Positions relative to each neighbourhood's centre [px], shape (B, k, 2).
        target: Where they went, relative to the same centre [px], shape (B, k, 2).
        weights: Prior weights, shape (B, k).
        iterations: Reweighting rounds, at least 1.

    Returns:
        The displacements b of the centres [px], shape (B, 2), and the residuals [px], shape (B, k).
    """
    design = np.concatenate([source / AFFINE_REACH_PX, np.ones((*source.shape[:2], 1))], axis=-1)
    identity = np.array([[AFFINE_REACH_PX, 0], [0, AFFINE_REACH_PX], [0, 0]])
    current = weights
    for _ in range(iterations):
        weighted = (design * current[..., None]).transpose(0, 2, 1)
        solution = np.linalg.solve(
            weighted @ design + _RIDGE, weighted @ target + _RIDGE @ identity
        )
        residuals = np.linalg.norm(design @ solution - target, axis=-1)
        current = weights / (1 + (residuals / _RESIDUAL_SCALE_PX) ** 2)
    return solution[:, 2], residuals


def agreeing_matches(
    source_px: np.ndarray,
    target_px: np.ndarray,
    *,
    neighbor_count: int = 12,
    tolerance_px: float = 4.0,
    passes: int = 2,
) -> np.ndarray:
    """Find the matches that move as an affine map fitted to their neighbours predicts.

    A match is kept if it lies within the tolerance of the map fitted to its nearest source
    neighbours (itself left out) and at least 40 % of those do too. The second pass judges among the
    survivors of the first.

    Args:
        source_px: Positions in the source [px], shape (M, 2).
        target_px: Positions in the target [px], shape (M, 2).
        neighbor_count: Neighbours to fit.
        tolerance_px: Largest distance from the prediction [px].
        passes: How often to repeat among the survivors.

    Returns:
        Bool, shape (M,); all False if there are not more matches than neighbours.
    """
    alive = np.arange(len(source_px))
    for _ in range(passes):
        if len(alive) <= neighbor_count:
            return np.zeros(len(source_px), bool)
        source = np.asarray(source_px, np.float64)[alive]
        target = np.asarray(target_px, np.float64)[alive]
        _, neighbors = KDTree(source).query(source, k=neighbor_count + 1)
        neighbors = np.asarray(neighbors)
        agrees = np.zeros(len(alive), bool)
        for start in range(0, len(alive), CHUNK):
            chunk = slice(start, start + CHUNK)
            agrees[chunk] = _agrees(
                source, target, chunk, neighbors[chunk, 1:], tolerance_px=tolerance_px
            )
        alive = alive[agrees]
    kept = np.zeros(len(source_px), bool)
    kept[alive] = True
    return kept


def _agrees(
    source: np.ndarray,
    target: np.ndarray,
    chunk: slice,
    neighbors: np.ndarray,
    *,
    tolerance_px: float,
) -> np.ndarray:
    centers = source[chunk]
    displacements = target[neighbors] - source[neighbors]
    typical = np.median(displacements, axis=1, keepdims=True)
    oddness = np.linalg.norm(displacements - typical, axis=-1)
    predicted, residuals = _fit_affine(
        source[neighbors] - centers[:, None],
        target[neighbors] - centers[:, None],
        1 / (1 + (oddness / 8.0) ** 2),
        iterations=4,
    )
    own_residuals = np.linalg.norm(target[chunk] - centers - predicted, axis=-1)
    support = (residuals < tolerance_px).mean(axis=1)
    return (own_residuals < tolerance_px) & (support >= _MIN_SUPPORT_SHARE)


def interpolate_flow(
    source_px: np.ndarray,
    target_px: np.ndarray,
    *,
    height_px: int,
    width_px: int,
    neighbor_count: int = 10,
    stride_px: int = 8,
) -> np.ndarray:
    """Spread matches over the image: pixels follow affine maps fitted to nearby matches.

    Args:
        source_px: Positions in the source, pixel centres at +0.5, shape (M, 2), M >= 1.
        target_px: Positions in the target, shape (M, 2).
        height_px: Height of the flow.
        width_px: Width of the flow.
        neighbor_count: Matches to fit, fewer if there are not as many.
        stride_px: Fits are made on a grid this fine and interpolated bilinearly [px].

    Returns:
        Displacement of each source pixel [px], float32, shape (H, W, 2).
    """
    import cv2

    source = np.asarray(source_px, np.float64)
    target = np.asarray(target_px, np.float64)
    columns = np.arange(0, width_px + stride_px, stride_px)
    rows = np.arange(0, height_px + stride_px, stride_px)
    nodes = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(np.float64)
    count = min(neighbor_count, len(source))
    distances, neighbors = KDTree(source).query(nodes, k=count)
    distances, neighbors = distances.reshape(-1, count), neighbors.reshape(-1, count)

    displacements = np.zeros((len(nodes), 2))
    for start in range(0, len(nodes), CHUNK):
        chunk = slice(start, start + CHUNK)
        centers = nodes[chunk, None]
        reach = np.maximum(distances[chunk, :1], 6.0)
        displacements[chunk], _ = _fit_affine(
            source[neighbors[chunk]] - centers,
            target[neighbors[chunk]] - centers,
            np.exp(-distances[chunk] / reach),
            iterations=5,
        )
    coarse = displacements.reshape(len(rows), len(columns), 2).astype(np.float32)
    # Nodes lie at pixel edges 0, stride, 2 stride, ...: node index = pixel centre / stride.
    node_columns = (np.arange(width_px, dtype=np.float32) + 0.5) / stride_px
    node_rows = (np.arange(height_px, dtype=np.float32) + 0.5) / stride_px
    return cv2.remap(coarse, *np.meshgrid(node_columns, node_rows), cv2.INTER_LINEAR)
