"""A reader of .glb and .gltf that shares no code with the exporter: json, struct, own arithmetic.

It understands what a viewer needs to play a skinned mesh: accessors, the node tree, one linear
animation and skins.
"""

import dataclasses
import json
import struct
from pathlib import Path
from urllib.parse import unquote

import numpy as np

FORMATS = {5121: "B", 5123: "H", 5125: "I", 5126: "f"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
NORMALIZED_MAX = {5121: 255.0, 5123: 65535.0}


@dataclasses.dataclass(frozen=True, eq=False)
class GltfFile:
    """One document and its buffer."""

    json: dict
    blob: bytes

    def accessor(self, index: int) -> np.ndarray:
        """Decode one accessor, float64, shape (count, width); normalized integers become 0..1."""
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        width, code = WIDTHS[accessor["type"]], FORMATS[accessor["componentType"]]
        row = struct.Struct(f"<{width}{code}")
        stride = view.get("byteStride", row.size)
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        rows = [row.unpack_from(self.blob, start + i * stride) for i in range(accessor["count"])]
        values = np.array(rows, dtype=np.float64)
        return (
            values / NORMALIZED_MAX[accessor["componentType"]] if accessor["normalized"] else values
        )

    def node(self, name: str) -> int:
        """Return the index of the only node of this name."""
        (index,) = [i for i, node in enumerate(self.json["nodes"]) if node.get("name") == name]
        return index

    def attributes(self, node_name: str) -> dict[str, np.ndarray]:
        """Decode all vertex attributes of the only primitive of a node's mesh."""
        mesh = self.json["meshes"][self.json["nodes"][self.node(node_name)]["mesh"]]
        (primitive,) = mesh["primitives"]
        return {name: self.accessor(index) for name, index in primitive["attributes"].items()}

    def channels(self) -> dict[tuple[int, str], tuple[np.ndarray, np.ndarray]]:
        """Return (key times [s], key values) of each animated (node, path)."""
        found = {}
        for animation in self.json.get("animations", []):
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                assert sampler["interpolation"] == "LINEAR"
                times, values = self.accessor(sampler["input"]), self.accessor(sampler["output"])
                found[channel["target"]["node"], channel["target"]["path"]] = times[:, 0], values
        return found

    def world_matrices(self, time_s: float) -> list[np.ndarray]:
        """Return world-from-node of every node at one time, for column vectors, each (4, 4)."""
        channels = self.channels()
        nodes = self.json["nodes"]
        parents = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}

        def value(index: int, path: str, default: list[float]) -> np.ndarray:
            if (index, path) in channels:
                return sample(*channels[index, path], time_s, is_rotation=path == "rotation")
            return np.array(nodes[index].get(path, default), dtype=np.float64)

        def world(index: int) -> np.ndarray:
            matrix = np.eye(4)
            matrix[:3, :3] = rotation_matrix(value(index, "rotation", [0.0, 0.0, 0.0, 1.0]))
            matrix[:3, 3] = value(index, "translation", [0.0, 0.0, 0.0])
            return world(parents[index]) @ matrix if index in parents else matrix

        return [world(index) for index in range(len(nodes))]

    def skinned_positions(self, node_name: str, time_s: float) -> np.ndarray:
        """Return the world positions of a skinned mesh's vertices [m], shape (V, 3)."""
        skin = self.json["skins"][self.json["nodes"][self.node(node_name)]["skin"]]
        # Column-major: each row of the accessor is the transpose of the matrix.
        inverse_binds = self.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
        worlds = self.world_matrices(time_s)
        joints = [
            worlds[node] @ stored.T
            for node, stored in zip(skin["joints"], inverse_binds, strict=True)
        ]
        mesh = self.attributes(node_name)
        positions = np.zeros_like(mesh["POSITION"])
        for vertex, point in enumerate(mesh["POSITION"]):
            pairs = zip(mesh["JOINTS_0"][vertex], mesh["WEIGHTS_0"][vertex], strict=True)
            blend = sum(weight * joints[int(joint)] for joint, weight in pairs)
            positions[vertex] = blend[:3, :3] @ point + blend[:3, 3]
        return positions


def read(path: Path) -> GltfFile:
    """Read a .glb, or a .gltf and the one buffer beside it."""
    data = path.read_bytes()
    if path.suffix != ".glb":
        document = json.loads(data)
        (buffer,) = document["buffers"]
        blob = (path.parent / unquote(buffer["uri"])).read_bytes()
        assert len(blob) == buffer["byteLength"]
        return GltfFile(document, blob)
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    chunks = {}
    offset = 12
    while offset < length:
        size, kind = struct.unpack_from("<I4s", data, offset)
        assert size % 4 == 0
        chunks[kind] = data[offset + 8 : offset + 8 + size]
        offset += 8 + size
    document = json.loads(chunks[b"JSON"])
    (buffer,) = document["buffers"]
    return GltfFile(document, chunks[b"BIN\0"][: buffer["byteLength"]])


def sample(
    times: np.ndarray, values: np.ndarray, time_s: float, *, is_rotation: bool
) -> np.ndarray:
    """Evaluate one LINEAR channel; rotations by slerp (glTF 2.0, appendix C.4), held outside."""
    if time_s <= times[0]:
        return values[0]
    if time_s >= times[-1]:
        return values[-1]
    after = int(np.argmax(times > time_s))
    before = after - 1
    share = (time_s - times[before]) / (times[after] - times[before])
    start, end = values[before], values[after]
    if not is_rotation:
        return start + share * (end - start)
    cosine = float(start @ end)
    end = np.sign(cosine) * end
    angle = np.arccos(min(abs(cosine), 1.0))
    if angle < 1e-3:
        # The cosine of float32 keys cannot tell such an angle; the chord is the arc by now.
        mixed = start + share * (end - start)
    else:
        mixed = np.sin((1 - share) * angle) * start + np.sin(share * angle) * end
    return mixed / np.linalg.norm(mixed)


def rotation_matrix(quat_xyzw: np.ndarray) -> np.ndarray:
    """Return the matrix of a unit quaternion as v + 2 w (u x v) + 2 u x (u x v), u = (x, y, z)."""
    x, y, z, w = quat_xyzw
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross
