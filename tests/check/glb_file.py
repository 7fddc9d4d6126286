"""A .glb to be broken: its JSON as objects, its binary chunk as writable arrays."""

import dataclasses
import json
import struct
from pathlib import Path

import numpy as np

DTYPES = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclasses.dataclass(eq=False)
class GlbFile:
    """The two chunks, taken apart by hand."""

    json: dict
    blob: bytearray

    @classmethod
    def read(cls, path: Path) -> "GlbFile":
        data = path.read_bytes()
        (length,) = struct.unpack_from("<I", data, 12)
        return cls(json.loads(data[20 : 20 + length]), bytearray(data[28 + length :]))

    def array(self, accessor: int) -> np.ndarray:
        """Return the numbers of an accessor, to be changed in place, shape (count, width)."""
        described = self.json["accessors"][accessor]
        view = self.json["bufferViews"][described["bufferView"]]
        start = view.get("byteOffset", 0) + described.get("byteOffset", 0)
        width = WIDTHS[described["type"]]
        dtype = np.dtype(DTYPES[described["componentType"]])
        values = np.frombuffer(self.blob, dtype, described["count"] * width, start)
        return values.reshape(-1, width)

    def node(self, name: str) -> dict:
        (found,) = [node for node in self.json["nodes"] if node["name"] == name]
        return found

    def primitive(self, node_name: str) -> dict:
        (found,) = self.json["meshes"][self.node(node_name)["mesh"]]["primitives"]
        return found

    def attribute(self, node_name: str, name: str) -> np.ndarray:
        return self.array(self.primitive(node_name)["attributes"][name])

    def sampler(self, path: str) -> tuple[int, dict]:
        """Return the first sampler that drives a property."""
        animation = self.json["animations"][0]
        for channel in animation["channels"]:
            if channel["target"]["path"] == path:
                return channel["sampler"], animation["samplers"][channel["sampler"]]
        raise KeyError(path)

    def write(self, path: Path) -> None:
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text
        body += struct.pack("<I4s", len(self.blob), b"BIN\0") + self.blob
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
