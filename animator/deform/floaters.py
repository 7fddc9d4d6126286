"""Floaters: Gaussians in the air that belong to nothing, as captures have them.

To a fit they are harmful: they get anchors, tie limbs together through empty space, and stand in the frame where the
object is not. What an object is made of overlaps, or one would see through it; so what no chain of overlapping
Gaussians joins to a sizable piece of the model is a floater.
"""

import dataclasses
import logging

import numpy as np
import torch
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from animator.types import SOLID_OPACITY, Gaussians

logger = logging.getLogger(__name__)

_OVERLAP_SIGMAS = 2.0
"""Two Gaussians overlap if this many of their largest sigmas each bridge their distance."""
_LEAST_SHARE = 0.005
"""A smaller piece floats [share of the solid Gaussians]."""
_MOST_SHARE = 0.2
"""If more would float, the model is not made of Gaussians that overlap, and nothing can be told."""
_NEIGHBORS = 16
_CHUNK = 100_000
"""Gaussians whose neighbors are looked up at a time, to save memory."""


def without_floaters(gaussians: Gaussians) -> Gaussians:
    """Make floaters invisible; they stay in the list, so that they can be carried along.

    Args:
        gaussians: The rest pose, N of them.

    Returns:
        N Gaussians, the floaters with opacity 0. Warns with their count if there are any.
    """
    floats = find_floaters(gaussians)
    if not floats.any():
        return gaussians
    logger.warning(
        "%s of %s Gaussians float apart from the object: they follow what is near them, and are not "
        "compared with the frames; remove them in a splat editor if you do not want them",
        f"{int(floats.sum()):,}",
        f"{len(gaussians):,}",
    )
    opacities = gaussians.opacities.clone()
    opacities[torch.as_tensor(floats, device=opacities.device)] = 0.0
    return dataclasses.replace(gaussians, opacities=opacities)


def find_floaters(gaussians: Gaussians) -> np.ndarray:
    """Tell which solid Gaussians belong to no sizable piece, bool, shape (N,)."""
    floats = np.zeros(len(gaussians), bool)
    solid = np.flatnonzero(gaussians.opacities.detach().cpu().numpy() > SOLID_OPACITY)
    neighbors = min(_NEIGHBORS, len(solid) - 1)
    if neighbors < 1:
        return floats
    places = gaussians.means.detach().cpu().numpy().astype(np.float64)[solid]
    reach = _OVERLAP_SIGMAS * gaussians.scales.detach().cpu().numpy().max(axis=1)[solid]
    tree = KDTree(places)
    links = []
    for first in range(0, len(solid), _CHUNK):
        own = np.arange(first, min(first + _CHUNK, len(solid)))
        distances, ids = (
            np.asarray(part)[:, 1:] for part in tree.query(places[own], k=neighbors + 1)
        )
        overlap = distances < reach[own, None] + reach[ids]
        links.append(np.stack([np.repeat(own, overlap.sum(axis=1)), ids[overlap]]))
    rows, columns = np.concatenate(links, axis=1)
    graph = coo_matrix((np.ones(len(rows), bool), (rows, columns)), (len(solid), len(solid)))
    _, pieces = connected_components(graph, directed=False)
    apart = np.bincount(pieces)[pieces] < _LEAST_SHARE * len(solid)
    if apart.mean() <= _MOST_SHARE:
        floats[solid] = apart
    return floats
