"""Anchors of the deformation: voxel means of the Gaussians, their graph and the skinning weights.

Distances run along the object (geodesic over a nearest-neighbor graph of the Gaussians), so that an arm
resting on a hip does not drag the hip along.
"""

import dataclasses
import math

import numpy as np
import torch
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from animator.types import SOLID_OPACITY, Anchors, Gaussians

INFLUENCES = 4
"""Anchors a Gaussian follows: one glTF JOINTS_0/WEIGHTS_0 set holds exactly these."""
GRAPH_NODES = 20_000
"""Gaussians that carry the geodesic graph; the others borrow the distances of their nearest one."""
_GRAPH_NEIGHBORS = 8
_ANCHOR_NEIGHBORS = 8
_REACH_VOXELS = 6.0
"""Geodesic distances are followed up to this many voxels."""
_EDGE_VOXELS = 3.0
"""Longest edge of the anchor graph in voxels."""
_LINKS_BETWEEN_COMPONENTS = 3
_UNREACHABLE = 1e6
"""Added to the Euclidean distance of an anchor on another connected component: it is only a last resort."""


def build_anchors(gaussians: Gaussians, *, target_count: int) -> Anchors:
    """Place about `target_count` anchors and bind every Gaussian to four of them.

    Args:
        gaussians: The rest pose.
        target_count: Wanted number of anchors; the voxel size is searched for it.

    Returns:
        Anchors whose graph is connected, with Gaussian-of-distance weights exp(-d^2 / 2 h^2), h the voxel size.
    """
    means = gaussians.means.detach().cpu().numpy().astype(np.float64)
    solid = np.flatnonzero(gaussians.opacities.detach().cpu().numpy() > SOLID_OPACITY)
    if len(solid) == 0:
        solid = np.arange(len(means))
    nodes = solid[:: max(1, math.ceil(len(solid) / GRAPH_NODES))]
    positions, spacing = _voxel_means(means[solid], gaussians.diagonal, target_count)

    distances = _distances_along_object(means[nodes], positions, spacing)
    node_ids, node_weights = _skin_weights(distances, spacing)
    nearest_node = KDTree(means[nodes]).query(means)[1]
    anchor_node = KDTree(means[nodes]).query(positions)[1]
    edges, edge_weights = _anchor_graph(positions, distances[:, anchor_node], spacing)

    return Anchors(
        positions=torch.as_tensor(positions, dtype=torch.float32),
        spacing=spacing,
        skin_ids=torch.as_tensor(node_ids[nearest_node], dtype=torch.int32),
        skin_weights=torch.as_tensor(node_weights[nearest_node], dtype=torch.float32),
        edges=torch.as_tensor(edges, dtype=torch.int64),
        edge_weights=torch.as_tensor(edge_weights, dtype=torch.float32),
    )


def with_sharper_skin(anchors: Anchors, sharpness: float) -> Anchors:
    """Return the same anchors with skinning weights raised to a power.

    A power s of exp(-d^2 / 2 h^2) is what a reach of h / sqrt(s) gives: each Gaussian follows its nearest anchor more.
    """
    weights = anchors.skin_weights**sharpness
    return dataclasses.replace(anchors, skin_weights=weights / weights.sum(dim=1, keepdim=True))


def nearest_gaussians(gaussians: Gaussians, anchors: Anchors) -> np.ndarray:
    """Find the Gaussian nearest to each anchor at rest, int64, shape (A,)."""
    means = gaussians.means.detach().cpu().numpy()
    return np.asarray(KDTree(means).query(anchors.positions.cpu().numpy())[1])


def distances_between(anchors: Anchors) -> np.ndarray:
    """Measure how far the anchors are from each other along their graph [scene unit], shape (A, A)."""
    places = anchors.positions.detach().cpu().numpy().astype(np.float64)
    first, second = anchors.edges.cpu().numpy().T
    lengths = np.linalg.norm(places[first] - places[second], axis=1)
    graph = coo_matrix((lengths, (first, second)), (len(places), len(places)))
    return np.asarray(dijkstra(graph.tocsr(), directed=False))


def distances_in_space(anchors: Anchors) -> np.ndarray:
    """Measure how far the anchors are from each other straight through space [scene unit], shape (A, A)."""
    places = anchors.positions.detach().cpu().numpy().astype(np.float64)
    return cdist(places, places)


def _voxel_means(
    points: np.ndarray, diagonal: float, target_count: int
) -> tuple[np.ndarray, float]:
    """Average the points in voxels whose size gives about the wanted count; thin voxels are dropped."""
    low, high = diagonal / 500, diagonal
    spacing, cells = high, np.zeros(len(points), np.int64)
    for _ in range(25):
        spacing = math.sqrt(low * high)
        cells = _cell_numbers(points, spacing)
        if len(np.unique(cells)) > target_count:
            low = spacing
        else:
            high = spacing
    _, voxel, counts = np.unique(cells, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, voxel, points)
    populated = counts >= min(counts.max(), max(3.0, 0.05 * float(np.median(counts))))
    return (sums / counts[:, None])[populated], spacing


def _cell_numbers(points: np.ndarray, spacing: float) -> np.ndarray:
    """Number the voxel of each point, int64, shape (M,)."""
    cells = np.floor((points - points.min(axis=0)) / spacing).astype(np.int64)
    shape = tuple(cells.max(axis=0) + 1)
    return np.asarray(np.ravel_multi_index(tuple(cells.T), shape))


def _distances_along_object(nodes: np.ndarray, anchors: np.ndarray, spacing: float) -> np.ndarray:
    """Measure anchor-to-node distances along the graph of nodes, never shorter than straight. Shape (A, nodes)."""
    count = len(nodes)
    neighbors = min(_GRAPH_NEIGHBORS, count - 1)
    tree = KDTree(nodes)
    straight = np.linalg.norm(anchors[:, None] - nodes[None], axis=-1)
    if neighbors < 1:
        return straight
    lengths, ids = (np.asarray(part)[:, 1:] for part in tree.query(nodes, k=neighbors + 1))
    close = lengths < 3.0 * np.median(lengths[:, : max(1, neighbors // 2)])
    rows = np.repeat(np.arange(count), neighbors).reshape(count, neighbors)
    graph = csr_matrix(
        (np.maximum(lengths[close], 1e-12), (rows[close], ids[close])), (count, count)
    )
    graph = graph.maximum(graph.T)
    starts = tree.query(anchors)[1]
    along = dijkstra(graph, directed=False, indices=starts, limit=_REACH_VOXELS * spacing)
    return np.where(np.isinf(along), _UNREACHABLE + straight, np.maximum(along, straight))


def _skin_weights(distances: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Choose the nearest anchors of each node. Returns ids and weights, shape (nodes, 4)."""
    by_node = distances.T
    anchor_count = by_node.shape[1]
    kept = min(INFLUENCES, anchor_count)
    ids = np.argpartition(by_node, kept - 1, axis=1)[:, :kept]
    ids = np.take_along_axis(
        ids, np.argsort(np.take_along_axis(by_node, ids, axis=1), axis=1), axis=1
    )
    nearest = np.take_along_axis(by_node, ids, axis=1)
    unreachable = nearest >= _UNREACHABLE
    nearest = np.where(unreachable, nearest - _UNREACHABLE, nearest)
    # Relative to the nearest anchor, so that a Gaussian far from all of them keeps finite weights.
    weights = np.exp((nearest[:, :1] ** 2 - nearest**2) / (2 * spacing**2))
    weights[unreachable & ~unreachable[:, :1]] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    padding = ((0, 0), (0, INFLUENCES - kept))
    return np.pad(ids, padding), np.pad(weights, padding)


def _anchor_graph(
    anchors: np.ndarray, between: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Link each anchor to its neighbors along the object and join what is left apart by its shortest gaps."""
    count = len(anchors)
    along = np.minimum(between, between.T)
    np.fill_diagonal(along, np.inf)
    nearest = np.argsort(along, axis=1)[:, :_ANCHOR_NEIGHBORS]
    rows = np.repeat(np.arange(count), nearest.shape[1])
    columns = nearest.ravel()
    close = along[rows, columns] < _EDGE_VOXELS * spacing
    linked = np.zeros((count, count), bool)
    linked[rows[close], columns[close]] = True
    linked |= linked.T

    straight = np.linalg.norm(anchors[:, None] - anchors[None], axis=-1)
    while True:
        components, labels = connected_components(coo_matrix(linked), directed=False)
        if components <= 1:
            break
        apart = labels == np.argmin(np.bincount(labels))
        gaps = np.where(apart[:, None] & ~apart[None], straight, np.inf)
        shortest = np.argsort(gaps, axis=None)[:_LINKS_BETWEEN_COMPONENTS]
        for first, second in zip(*np.unravel_index(shortest, gaps.shape), strict=True):
            if np.isfinite(gaps[first, second]):
                linked[first, second] = linked[second, first] = True
    edges = np.argwhere(linked)
    lengths = straight[linked]
    weights = np.exp(-(lengths**2) / (2 * (1.5 * spacing) ** 2))
    # A link across a gap is long; it must still hold the parts together.
    weights = np.maximum(weights, 1e-3)
    return edges, weights / weights.mean() if len(weights) else weights
