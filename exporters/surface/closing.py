"""Closed triangle meshes: every edge has two faces, which pass it in opposite directions."""

from collections.abc import Iterator

import numpy as np

SLIVER = 0.01
"""Pieces of less volume than this, in cubes of the shortest length, are folded sheets."""


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


def solid_pieces(
    positions: np.ndarray, triangles: np.ndarray, least_length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Keep what encloses a volume of some size: no crumbs, no slivers, no walls of hollows.

    Args:
        positions: Vertices, shape (V, 3).
        triangles: Faces of a closed mesh, shape (F, 3).
        least_length: Shortest diagonal of the box around a piece [scene unit].

    Returns:
        The vertices and faces of the pieces that stay.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Pieces may touch in a vertex, so that only faces with a common edge are one piece.
    edges, _, _ = _edges(triangles)
    by_edge = np.argsort(_keys(edges), kind="stable")
    first, second = (by_edge % len(triangles)).reshape(-1, 2).T
    links = coo_array((np.ones(len(first)), (first, second)), shape=(len(triangles),) * 2)
    piece_count, pieces = connected_components(links, directed=False)
    corners = positions[triangles].astype(np.float64)
    low = np.full((piece_count, 3), np.inf)
    high = np.full((piece_count, 3), -np.inf)
    np.minimum.at(low, pieces, corners.min(axis=1))
    np.maximum.at(high, pieces, corners.max(axis=1))
    # The signed volumes of the tetrahedra from the origin to each face; a hollow's wall is below 0.
    volumes = np.bincount(pieces, weights=np.linalg.det(corners) / 6, minlength=piece_count)
    is_kept = np.linalg.norm(high - low, axis=1) >= least_length
    is_kept &= volumes >= SLIVER * least_length**3
    used, kept = np.unique(triangles[is_kept[pieces]], return_inverse=True)
    return positions[used], kept.reshape(-1, 3)


def _edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Describe the directed edges of faces, three a face, edge i of face f at i * F + f.

    Returns:
        Start and end, shape (3F, 2); how many faces have the edge in any direction, and whether as
        many pass it one way as the other, both of shape (3F,).
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    directions = np.sign(edges[:, 1] - edges[:, 0])
    _, keys, counts = np.unique(_keys(edges), return_inverse=True, return_counts=True)
    balance = np.bincount(keys, weights=directions, minlength=len(counts))
    return edges, counts[keys], (balance == 0)[keys]


def _keys(edges: np.ndarray) -> np.ndarray:
    """Return one number for each edge, the same for both directions, shape (E,)."""
    low, high = np.sort(edges.astype(np.int64), axis=1).T
    return low * (edges.max(initial=0) + 1) + high


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
