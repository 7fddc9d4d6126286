"""Each rule for the document, its buffers, nodes and meshes catches a .glb broken in that one way."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from exporters.check import check_file
from tests.check.glb_edits import (
    MESH,
    Edit,
    attribute,
    attribute_index,
    drop,
    good_glb,
    member,
    own_parent,
    put,
    sampler_index,
)
from tests.check.glb_file import GlbFile

EDITS: dict[str, tuple[Edit, str]] = {
    # document
    "version": (
        put(lambda j: j["asset"], "version", "1.0"),
        "/asset/version: expected 2.0, found '1.0'",
    ),
    "no asset": (drop(lambda j: j, "asset"), "/asset: expected object, found nothing"),
    "wrong type": (
        put(lambda j: j["nodes"][0], "children", "all"),
        "/nodes/0/children: expected a list of index into nodes, found 'all'",
    ),
    "bool for a number": (
        put(lambda j: j["accessors"][1], "count", True),
        "/accessors/1/count: expected integer, found True",
    ),
    "dangling index": (
        put(lambda j: j["scenes"][0]["nodes"], 0, 999),
        "/scenes/0/nodes/0: expected an index into",
    ),
    "negative count": (
        put(lambda j: j["accessors"][0], "count", -1),
        "/accessors/0/count: expected an integer >= 0",
    ),
    "endless number": (
        put(lambda j: j["nodes"][0], "translation", [10**400, 0, 0]),
        "/nodes/0/translation/0: expected a number that floats can hold",
    ),
    "animated node that is none": (
        put(lambda j: j["animations"][0]["channels"][0]["target"], "node", 77),
        "/animations/0/channels/0/target/node: expected an index into",
    ),
    # buffers and accessors
    "longer buffer": (
        put(lambda j: j["buffers"][0], "byteLength", 10**9),
        "/buffers/0: expected 1000000000 bytes",
    ),
    "buffer outside": (
        put(lambda j: j["buffers"][0], "uri", "../secret.bin"),
        "/buffers/0/uri: expected a path in the folder of the file, found '../secret.bin'",
    ),
    "buffer outside, disguised": (
        put(lambda j: j["buffers"][0], "uri", "%2e%2e/secret.bin"),
        "/buffers/0/uri: expected a path in the folder of the file",
    ),
    "buffer that is not there": (
        put(lambda j: j["buffers"][0], "uri", "gone.bin"),
        "/buffers/0/uri: expected a file that can be read, found 'gone.bin': No such file",
    ),
    "bad data uri": (
        put(lambda j: j["buffers"][0], "uri", "data:application/octet-stream;base64,?"),
        "/buffers/0/uri: expected base64",
    ),
    "view past the buffer": (
        put(lambda j: j["bufferViews"][0], "byteOffset", 10**7),
        "/bufferViews/0: expected an end within the buffer's",
    ),
    "count past the view": (
        member(attribute_index(MESH, "WEIGHTS_0"), count=10**12),
        "/accessors/4: expected elements within the view's 512 bytes, found 1000000000000 of 16",
    ),
    "component type": (
        member(attribute_index(MESH, "WEIGHTS_0"), componentType=5130),
        "/accessors/4: expected a componentType, a type and a count of glTF 2.0",
    ),
    "odd offset": (
        member(attribute_index(MESH, "WEIGHTS_0"), byteOffset=2, count=31),
        "/accessors/4: expected elements on multiples of 4 bytes",
    ),
    "not finite": (
        attribute(MESH, "NORMAL", (3, 1), np.nan),
        "/accessors/1: expected finite numbers, found 1 numbers that are not finite (first at (3, 1))",
    ),
    "bounds of positions": (
        member(attribute_index(MESH, "POSITION"), max=[0.0, 0.0, 0.0]),
        "/accessors/0/max: expected [",
    ),
    "bounds of times": (
        member(sampler_index("rotation", "input"), max=[9.0]),
        "/max: expected [",
    ),
    "no bounds of positions": (
        member(attribute_index(MESH, "POSITION"), min=None),
        "/meshes/0/primitives/0/attributes/POSITION: expected min and max in accessor 0, found no min",
    ),
    "no bounds of times": (
        member(sampler_index("rotation", "input"), max=None),
        "expected min and max in accessor",
    ),
    # nodes
    "two parents": (
        lambda glb: glb.node("carrier").__setitem__("children", [1]),
        "/children: expected nodes with one parent",
    ),
    "above itself": (own_parent, "expected a tree, found a node that is above itself"),
    "child in a scene": (
        put(lambda j: j["scenes"][0]["nodes"], 0, 1),
        "/scenes/0/nodes: expected nodes without a parent",
    ),
    "short rotation": (
        put(lambda j: j["nodes"][1], "rotation", [0.0, 0.0, 1.0]),
        "/nodes/1/rotation: expected 4 numbers, found 3",
    ),
    "long rotation": (
        put(lambda j: j["nodes"][1], "rotation", [0.0, 0.0, 1.0, 1.0]),
        "/nodes/1/rotation: expected unit quaternions",
    ),
    "matrix and rotation": (
        put(lambda j: j["nodes"][1], "matrix", np.eye(4).ravel().tolist()),
        "/nodes/1: expected a matrix, or translation, rotation and scale, found both",
    ),
    # meshes
    "no positions": (
        lambda glb: glb.primitive(MESH)["attributes"].pop("POSITION"),
        "/meshes/0/primitives/0/attributes: expected POSITION, found",
    ),
    "short attribute": (
        member(attribute_index(MESH, "NORMAL"), count=31),
        "/meshes/0/primitives/0/attributes/NORMAL: expected 32 values, as many as POSITION, found 31",
    ),
    "type of an attribute": (
        member(attribute_index(MESH, "WEIGHTS_0"), type="VEC3"),
        "/attributes/WEIGHTS_0: expected VEC4 float32 or",
    ),
    "index of no vertex": (
        lambda glb: glb.array(glb.primitive(MESH)["indices"]).__setitem__(7, 32),
        "/meshes/0/primitives/0/indices: expected vertices 0..31, found 1 indices of others (first at 7)",
    ),
    "index type": (
        member(lambda glb: glb.primitive(MESH)["indices"], componentType=5126),
        "/indices: expected SCALAR uint16 or SCALAR uint32 or SCALAR uint8, found SCALAR float32",
    ),
    "two corners": (
        member(lambda glb: glb.primitive(MESH)["indices"], count=47),
        "/indices: expected three indices a triangle, found 47 indices",
    ),
}
"""By name: what is done to a good file, and part of what must be said. `{rotation}` stands for the
number of the first sampler of rotations."""


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return good_glb(tmp_path_factory.mktemp("good"))


@pytest.mark.parametrize("mistake", EDITS)
def test_a_broken_glb_is_caught_in_its_place(mistake: str, good: Path, tmp_path: Path) -> None:
    edit, expected = EDITS[mistake]
    glb = GlbFile.read(good)
    for path in ("rotation", "translation"):
        expected = expected.replace(f"{{{path}}}", str(glb.sampler(path)[0]))
    edit(glb)
    glb.write(tmp_path / "broken.glb")
    said = [str(problem) for problem in check_file(tmp_path / "broken.glb")]
    assert any(expected in line for line in said), said


CONTAINERS = {
    "empty": (lambda data: b"", "GLB header: expected 12 bytes, found 0 bytes"),
    "magic": (lambda data: b"glTG" + data[4:], "GLB header: expected `glTF`, version 2"),
    "cut off": (lambda data: data[:-4], "GLB header: expected `glTF`"),
    "length": (
        lambda data: data[:12] + struct.pack("<I", 2**31) + data[16:],
        "GLB chunk 0: expected at most",
    ),
    "chunk order": (
        lambda data: data[:16] + b"BIN\0" + data[20:],
        "GLB chunk 0: expected the chunk JSON",
    ),
    "no JSON": (
        lambda data: data[:20] + b"!" + data[21:],
        "JSON: expected JSON in UTF-8 (RFC 8259)",
    ),
    "no text": (lambda data: data[:20] + b"\xff" + data[21:], "JSON: expected JSON in UTF-8"),
}


@pytest.mark.parametrize("mistake", CONTAINERS)
def test_a_broken_container_is_caught(mistake: str, good: Path, tmp_path: Path) -> None:
    edit, expected = CONTAINERS[mistake]
    (tmp_path / "broken.glb").write_bytes(edit(good.read_bytes()))
    (problem,) = check_file(tmp_path / "broken.glb")
    assert str(problem).startswith(expected)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[]", "JSON: expected an object, found list"),
        ('{"asset": {"version": NaN}}', "JSON: expected JSON in UTF-8 (RFC 8259), found NaN"),
        ("[" * 100_000, "JSON: expected JSON"),
        (
            '{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4}]}',
            "/buffers/0: expected a uri",
        ),
    ],
)
def test_broken_text_is_caught(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "broken.gltf").write_text(text)
    (problem,) = check_file(tmp_path / "broken.gltf")
    assert str(problem).startswith(expected)


def test_nodes_in_a_ring_are_found(tmp_path: Path) -> None:
    nodes = [{"children": [1]}, {"children": [2]}, {"children": [0]}, {"children": []}]
    text = json.dumps({"asset": {"version": "2.0"}, "nodes": nodes})
    (tmp_path / "ring.gltf").write_text(text)
    places = [problem.place for problem in check_file(tmp_path / "ring.gltf")]
    assert places == ["/nodes/0", "/nodes/1", "/nodes/2"]
