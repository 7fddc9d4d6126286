"""Closed triangle meshes: every edge has two faces, which pass it in opposite directions."""

from collections.abc import Iterator

import numpy as np


def closed(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut out the faces at edges that are wrong and close the holes by fans.

    Simplification may let two sheets meet in one edge. The faces there go; what remains has edges
    of two faces and, around holes, of one. The open edges form loops, since each face enters and
    leaves its vertices once; a fan around the loop's middle gives each edge its second face.

    Args:
        positions: Vertices, shape (V, 3).
        triangles: Faces, shape (F, 3).

    Returns:
        Vertices, those of the fans last, and faces; a closed mesh comes back as it is.
    """
    edges, face_counts, is_balanced = _edges(triangles)
    is_wrong = (face_counts > 2) | ((face_counts == 2) & ~is_balanced)
    is_cut = is_wrong.reshape(3, -1).any(axis=0)
    triangles = triangles[~is_cut]
    edges, face_counts, _ = _edges(triangles)
    pieces = [positions], [triangles]
    for loop in _loops(edges[face_counts == 1, ::-1]):
        hub = sum(len(piece) for piece in pieces[0])
        pieces[0].append(positions[loop].mean(axis=0, keepdims=True))
        pieces[1].append(np.stack([loop, np.roll(loop, -1), np.full(len(loop), hub)], axis=1))
    return np.concatenate(pieces[0]), np.concatenate(pieces[1])


def without_crumbs(
    positions: np.ndarray, triangles: np.ndarray, least_length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Drop connected pieces whose boxes have a shorter diagonal, and vertices without a face.

    Args:
        positions: Vertices, shape (V, 3).
        triangles: Faces, shape (F, 3).
        least_length: Shortest diagonal of a piece that stays [scene unit].
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(positions)
    links = triangles[:, :2].T, triangles[:, 1:].T
    starts, ends = np.concatenate(links, axis=1)
    graph = coo_array((np.ones(len(starts)), (starts, ends)), shape=(count, count))
    piece_count, pieces = connected_components(graph, directed=False)
    low = np.full((piece_count, 3), np.inf)
    high = np.full((piece_count, 3), -np.inf)
    np.minimum.at(low, pieces, positions)
    np.maximum.at(high, pieces, positions)
    is_kept = (np.linalg.norm(high - low, axis=1) >= least_length)[pieces]
    triangles = triangles[is_kept[triangles[:, 0]]]
    used, triangles = np.unique(triangles, return_inverse=True)
    return positions[used], triangles.reshape(-1, 3)


def _edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Describe the directed edges of faces, three a face, edge i of face f at i * F + f.

    Returns:
        Start and end, shape (3F, 2); how many faces have the edge in any direction, and whether as
        many pass it one way as the other, both of shape (3F,).
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    directions = np.sign(edges[:, 1] - edges[:, 0])
    _, keys, counts = np.unique(
        np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    keys = keys.reshape(-1)
    balance = np.bincount(keys, weights=directions, minlength=len(counts))
    return edges, counts[keys], (balance == 0)[keys]


def _loops(edges: np.ndarray) -> Iterator[np.ndarray]:
    """Split directed edges, as many into each vertex as out of it, into loops without a repeat."""
    ends: dict[int, list[int]] = {}
    for start, end in edges.tolist():
        ends.setdefault(start, []).append(end)
    for first in list(ends):
        path = [first]
        while ends[path[-1]]:
            following = ends[path[-1]].pop()
            if following in path:
                begin = path.index(following)
                yield np.array(path[begin:])
                del path[begin + 1 :]
            else:
                path.append(following)
