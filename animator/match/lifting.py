"""From pixels to Gaussians: which Gaussian a matched pixel shows, and where it should go."""

import logging

import numpy as np
from scipy.spatial import KDTree

from animator.match.protocol import FlowField
from animator.match.sampling import inside_mask
from animator.types import GaussianMatches, Matches

MIN_VISIBLE_SHARE = 0.3
"""A Gaussian is seen if this share of it is not hidden (the paper's test)."""

_log = logging.getLogger(__name__)


def lift_flow(
    flow: FlowField,
    centres_px: np.ndarray,
    visible_shares: np.ndarray,
    *,
    min_visible_share: float = MIN_VISIBLE_SHARE,
    max_count: int | None = None,
    rng: np.random.Generator | None = None,
) -> GaussianMatches:
    """Read the flow where each visible Gaussian projects.

    Displacement and trust are bilinear in the four pixels around the centre; pixels that are not
    trusted take no part in the displacement, and a Gaussian whose own pixel is not trusted is left
    out.

    Args:
        flow: Motion from the render to the frame.
        centres_px: Projected centers in the render, pixel centres at +0.5, shape (N, 2).
        visible_shares: How much of each Gaussian is seen there, 0..1, shape (N,).
        min_visible_share: Smallest visible share that counts as seen.
        max_count: Keep at most this many, evenly over the image; None keeps all.
        rng: Chooses among Gaussians in one image cell; needed with `max_count`.

    Returns:
        The matches, in ascending order of Gaussian.

    Raises:
        ValueError: If `max_count` is given without `rng`.
    """
    if max_count is not None and rng is None:
        raise ValueError("max_count needs rng: which Gaussians are dropped is a random choice")
    trusted = flow.confidences > 0
    visible = visible_shares > min_visible_share
    ids = np.flatnonzero(visible & inside_mask(trusted, centres_px))
    centers = centres_px[ids].astype(np.float64)
    displacements, confidences = _read_trusted(flow, centers)
    if max_count is not None and rng is not None and len(ids) > max_count:
        kept = spread_subset(centers, max_count, rng=rng)
        ids, centers = ids[kept], centers[kept]
        displacements, confidences = displacements[kept], confidences[kept]
    return GaussianMatches(
        gaussian_ids=ids.astype(np.int64),
        target_px=centers + displacements,
        confidences=confidences,
    )


def lift_matches(
    matches: Matches,
    centres_px: np.ndarray,
    visible_shares: np.ndarray,
    *,
    min_visible_share: float = MIN_VISIBLE_SHARE,
    max_distance_px: float = 1.0,
) -> GaussianMatches:
    """Give each matched pixel to the visible Gaussian that projects nearest (the paper's rule).

    A Gaussian that several pixels choose keeps the nearest of them. The small offset between pixel
    and Gaussian is carried over to the target, so that it does not become an error.

    Args:
        matches: Pixel pairs from the render to the frame.
        centres_px: Projected centers in the render, pixel centres at +0.5, shape (N, 2).
        visible_shares: How much of each Gaussian is seen there, 0..1, shape (N,).
        min_visible_share: Smallest visible share that counts as seen.
        max_distance_px: Farthest a Gaussian may project from the pixel [px].

    Returns:
        The matches, in ascending order of Gaussian.
    """
    finite = np.isfinite(centres_px).all(axis=1)
    visible_ids = np.flatnonzero((visible_shares > min_visible_share) & finite)
    if len(visible_ids) == 0 or len(matches) == 0:
        nothing = np.zeros(0)
        return GaussianMatches(
            gaussian_ids=nothing.astype(np.int64),
            target_px=np.zeros((0, 2)),
            confidences=nothing,
        )
    centers = centres_px[visible_ids].astype(np.float64)
    distances, nearest = KDTree(centers).query(matches.source_px.astype(np.float64))
    distances, nearest = np.asarray(distances), np.asarray(nearest)
    near = np.flatnonzero(distances <= max_distance_px)
    # Nearest first, so that `unique`, which keeps first occurrences, keeps the nearest pixel of
    # each Gaussian.
    near = near[np.lexsort((-matches.confidences[near], distances[near]))]
    chosen, first = np.unique(nearest[near], return_index=True)
    kept = near[first]
    offsets = centers[chosen] - matches.source_px[kept]
    dropped = len(matches) - len(kept)
    _log.debug(
        "%d of %d matched pixels show no visible Gaussian of their own", dropped, len(matches)
    )
    return GaussianMatches(
        gaussian_ids=visible_ids[chosen].astype(np.int64),
        target_px=matches.target_px[kept].astype(np.float64) + offsets,
        confidences=matches.confidences[kept].astype(np.float64),
    )


def spread_subset(points_px: np.ndarray, count: int, *, rng: np.random.Generator) -> np.ndarray:
    """Choose points so that every occupied part of the image keeps some.

    The image is cut into cells that hold about four chosen points each; each cell gives its points
    in random order, one a round, until there are enough.

    Args:
        points_px: Positions [px], shape (M, 2).
        count: How many to choose, at most M.
        rng: The source of randomness.

    Returns:
        Indices of the chosen points, ascending, shape (count,).
    """
    low, high = points_px.min(axis=0), points_px.max(axis=0)
    side = max(2.0 * np.sqrt(np.prod(np.maximum(high - low, 1.0)) / count), 1e-6)
    columns, rows = np.floor((points_px - low) / side).astype(np.int64).T
    cells = rows * (columns.max() + 1) + columns
    shuffled = rng.permutation(len(points_px))
    by_cell = shuffled[np.argsort(cells[shuffled], kind="stable")]
    sorted_cells = cells[by_cell]
    cell_starts = np.flatnonzero(np.diff(sorted_cells, prepend=-1))
    sizes = np.diff(cell_starts, append=len(by_cell))
    turn = np.arange(len(by_cell)) - np.repeat(cell_starts, sizes)
    order = np.lexsort((rng.random(len(by_cell)), turn))
    return np.sort(by_cell[order[:count]])


def _read_trusted(flow: FlowField, points_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Read displacement and trust bilinearly, the displacement from trusted pixels only."""
    height, width = flow.confidences.shape
    position = points_px - 0.5
    corner = np.floor(position).astype(np.int64)
    fraction = position - corner
    displacements = np.zeros((len(points_px), 2))
    trusted_weight = np.zeros(len(points_px))
    confidences = np.zeros(len(points_px))
    for down in (0, 1):
        for right in (0, 1):
            columns = np.clip(corner[:, 0] + right, 0, width - 1)
            rows = np.clip(corner[:, 1] + down, 0, height - 1)
            across = fraction[:, 0] if right else 1 - fraction[:, 0]
            along = fraction[:, 1] if down else 1 - fraction[:, 1]
            weights = across * along
            confidence = flow.confidences[rows, columns]
            confidences += weights * confidence
            weights = weights * (confidence > 0)
            displacements += weights[:, None] * flow.flow_px[rows, columns]
            trusted_weight += weights
    # The own pixel is trusted and has at least a quarter of the weight, so this never divides by
    # zero.
    return displacements / trusted_weight[:, None], confidences
