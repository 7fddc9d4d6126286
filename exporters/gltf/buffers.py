"""Arrays as accessors: one binary blob, every piece on a four-byte boundary.

Numbers stay float32, but for colors (16 bits) and indices. What smaller ones would do, measured on
clips of three walking and swimming objects, in diagonals:

* Weights of 16 bits, summing to 65535: centers move by up to 9e-7, the whole error that the default
  may have, to save 6 % of a .glb; of 8 bits by up to 2e-4.
* Positions of 16 bits (KHR_mesh_quantization, which then is required to open the file): 8e-6.
* meshopt or Draco: importers need a decoder (three.js has to be given it), or refuse the file.
"""

from collections.abc import Sequence

import numpy as np
import pygltflib

_COMPONENT_TYPES = {
    np.dtype(np.uint8): pygltflib.UNSIGNED_BYTE,
    np.dtype(np.uint16): pygltflib.UNSIGNED_SHORT,
    np.dtype(np.uint32): pygltflib.UNSIGNED_INT,
    np.dtype(np.float32): pygltflib.FLOAT,
}
_ELEMENT_TYPES = {
    1: pygltflib.SCALAR,
    3: pygltflib.VEC3,
    4: pygltflib.VEC4,
    16: pygltflib.MAT4,
}
_ALIGNMENT_BYTES = 4


class BinaryBuffer:
    """Collects arrays and describes them in a document.

    The document refers to the blob as buffer 0; `finish` puts both together.
    """

    def __init__(self, document: pygltflib.GLTF2) -> None:
        self._document = document
        self._pieces: list[bytes] = []
        self._length_bytes = 0

    def add_attribute(
        self, values: np.ndarray, *, normalized: bool = False, bounds: bool = False
    ) -> int:
        """Add one vertex attribute.

        Args:
            values: One row a vertex, shape (V,), (V, 3) or (V, 4).
            normalized: Whether the integers stand for 0..1.
            bounds: Whether to store the minimum and maximum, as POSITION requires.

        Returns:
            Index of the accessor.
        """
        view = self._add_view(values, pygltflib.ARRAY_BUFFER)
        return self._add_accessor(values, view, normalized=normalized, bounds=bounds)

    def add_indices(self, triangles: np.ndarray) -> int:
        """Add the vertex indices of triangles, shape (F, 3); return the accessor's index."""
        indices = triangles.astype(np.uint32).reshape(-1)
        view = self._add_view(indices, pygltflib.ELEMENT_ARRAY_BUFFER)
        return self._add_accessor(indices, view)

    def add_values(self, values: np.ndarray, *, bounds: bool = False) -> int:
        """Add matrices, or anything else that is no vertex attribute; return the accessor's index.

        Args:
            values: One row an element, shape (M,), (M, 3), (M, 4) or (M, 16).
            bounds: Whether to store the minimum and maximum.
        """
        return self._add_accessor(values, self._add_view(values, None), bounds=bounds)

    def add_tracks(self, tracks: Sequence[np.ndarray], *, bounds: bool = False) -> list[int]:
        """Add the key times or values of many channels as one view; return an accessor for each.

        Args:
            tracks: Float32 keys of each channel, shape (T,), (T, 3) or (T, 4), any T.
            bounds: Whether to store the minimum and maximum of each, as key times require.
        """
        view = self._add_view(np.concatenate(tracks), None)
        offsets_bytes = np.cumsum([0, *(track.nbytes for track in tracks)]).tolist()
        return [
            self._add_accessor(track, view, offset_bytes=offset_bytes, bounds=bounds)
            for track, offset_bytes in zip(tracks, offsets_bytes, strict=False)
        ]

    def finish(self) -> bytes:
        """Declare the buffer in the document and return its bytes."""
        self._document.buffers = [pygltflib.Buffer(byteLength=self._length_bytes)]
        return b"".join(self._pieces)

    def _add_view(self, values: np.ndarray, target: int | None) -> int:
        data = values.tobytes()
        view = pygltflib.BufferView(
            buffer=0, byteOffset=self._length_bytes, byteLength=len(data), target=target
        )
        data += bytes(-len(data) % _ALIGNMENT_BYTES)
        self._pieces.append(data)
        self._length_bytes += len(data)
        self._document.bufferViews.append(view)
        return len(self._document.bufferViews) - 1

    def _add_accessor(
        self,
        values: np.ndarray,
        view: int,
        *,
        offset_bytes: int = 0,
        normalized: bool = False,
        bounds: bool = False,
    ) -> int:
        rows = values.reshape(len(values), -1)
        accessor = pygltflib.Accessor(
            bufferView=view,
            byteOffset=offset_bytes,
            componentType=_COMPONENT_TYPES[values.dtype],
            normalized=normalized,
            count=len(rows),
            type=_ELEMENT_TYPES[rows.shape[1]],
        )
        if bounds:
            accessor.min = rows.min(axis=0).tolist()
            accessor.max = rows.max(axis=0).tolist()
        self._document.accessors.append(accessor)
        return len(self._document.accessors) - 1
