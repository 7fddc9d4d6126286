"""Each rule for glTF catches a file broken in that one way, and names the place."""

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from exporters import export_clip
from exporters.check import check_file
from tests.check.glb_file import GlbFile
from tests.helpers import clips

MESH, SPLATS = "carrier", "rest_splats"
KHR = "KHR_gaussian_splatting"


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("good") / "clip.glb"
    export_clip(clips.random(gaussians=8, joints=5, keys=4), path)
    assert check_file(path) == ()
    return path


def attribute(node: str, name: str, index: object, value: object) -> Callable[[GlbFile], None]:
    """Overwrite some numbers of an attribute."""
    return lambda glb: glb.attribute(node, name).__setitem__(index, value)


def output(path: str, change: Callable[[np.ndarray], None]) -> Callable[[GlbFile], None]:
    """Change the key values of the first channel of a property."""
    return lambda glb: change(glb.array(glb.sampler(path)[1]["output"]))


def clock(change: Callable[[np.ndarray], None]) -> Callable[[GlbFile], None]:
    """Change the key times, and their bounds with them."""

    def edit(glb: GlbFile) -> None:
        index = glb.sampler("rotation")[1]["input"]
        times = glb.array(index)
        change(times)
        glb.json["accessors"][index] |= {"min": [float(times.min())], "max": [float(times.max())]}

    return edit


def member(accessor_of: Callable[[GlbFile], int], **values: object) -> Callable[[GlbFile], None]:
    """Overwrite members of an accessor; None removes one."""

    def edit(glb: GlbFile) -> None:
        accessor = glb.json["accessors"][accessor_of(glb)]
        for key, value in values.items():
            accessor[key] = value
            if value is None:
                del accessor[key]

    return edit


def attribute_index(node: str, name: str) -> Callable[[GlbFile], int]:
    return lambda glb: glb.primitive(node)["attributes"][name]


def sampler_index(path: str, end: str) -> Callable[[GlbFile], int]:
    return lambda glb: glb.sampler(path)[1][end]


def inverse_binds(glb: GlbFile) -> int:
    return glb.json["skins"][0]["inverseBindMatrices"]


def put(container: Callable[[dict], dict | list], key: object, value: object):
    """Set one thing in the JSON."""
    return lambda glb: container(glb.json).__setitem__(key, value)


def drop(container: Callable[[dict], dict | list], key: object):
    """Take one thing out of the JSON."""
    return lambda glb: container(glb.json).__delitem__(key)


def splat_attributes(json_: dict) -> dict:
    (mesh,) = [mesh for mesh in json_["meshes"] if mesh["name"] == SPLATS]
    return mesh["primitives"][0]["attributes"]


def splat_extension(json_: dict) -> dict:
    (mesh,) = [mesh for mesh in json_["meshes"] if mesh["name"] == SPLATS]
    return mesh["primitives"][0]["extensions"][KHR]


def second_root(glb: GlbFile) -> None:
    joint = glb.json["skins"][0]["joints"][1]
    for node in glb.json["nodes"]:
        node["children"] = [child for child in node.get("children", []) if child != joint]


def own_parent(glb: GlbFile) -> None:
    joints = glb.json["skins"][0]["joints"]
    glb.json["nodes"][joints[-1]]["children"] = [joints[-1]]


def matrix_on_moving_node(glb: GlbFile) -> None:
    target = glb.json["animations"][0]["channels"][0]["target"]["node"]
    node = glb.json["nodes"][target]
    del node["translation"], node["rotation"]
    node["matrix"] = np.eye(4).ravel().tolist()


def channel_twice(glb: GlbFile) -> None:
    channels = glb.json["animations"][0]["channels"]
    channels.append(channels[0])


def repeat_joint(glb: GlbFile) -> None:
    glb.attribute(MESH, "JOINTS_0")[5] = [2, 2, 0, 0]
    glb.attribute(MESH, "WEIGHTS_0")[5] = [0.5, 0.5, 0, 0]


def transpose(matrices: np.ndarray) -> None:
    matrices[:] = matrices.reshape(-1, 4, 4).swapaxes(1, 2).reshape(-1, 16)


EDITS: dict[str, tuple[Callable[[GlbFile], object], str]] = {
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
    # skins
    "joint out of range": (
        attribute(MESH, "JOINTS_0", (9, 3), 5),
        "/meshes/0/primitives/0/attributes/JOINTS_0: expected joints 0..4, found 1 vertices with another "
        "joint (first at 9)",
    ),
    "fewer joints": (
        lambda glb: glb.json["skins"][0]["joints"].pop(),
        "/attributes/JOINTS_0: expected joints 0..3",
    ),
    "weights scaled": (
        attribute(MESH, "WEIGHTS_0", 2, [0.5, 0.4, 0.0, 0.0]),
        "/attributes/WEIGHTS_0: expected weights that sum to 1, found 1 vertices whose weights do not",
    ),
    "negative weight": (
        attribute(MESH, "WEIGHTS_0", 2, [1.5, -0.5, 0.0, 0.0]),
        "/attributes/WEIGHTS_0: expected weights >= 0",
    ),
    "joint twice": (repeat_joint, "/attributes/JOINTS_0: expected different joints in a vertex"),
    "no weights": (
        lambda glb: glb.primitive(MESH)["attributes"].pop("WEIGHTS_0"),
        "/meshes/0/primitives/0/attributes: expected JOINTS_0 and WEIGHTS_0, for the skin of the node, "
        "found JOINTS_0",
    ),
    "skin without a mesh": (
        lambda glb: glb.node("carrier").pop("mesh"),
        ": expected a mesh to skin, found none",
    ),
    "two root joints": (second_root, "/skins/0/joints: expected one root joint, found 2, nodes"),
    "joints repeated": (
        lambda glb: glb.json["skins"][0]["joints"].__setitem__(
            2, glb.json["skins"][0]["joints"][1]
        ),
        "/skins/0/joints: expected different nodes, at least one, found 5, of which 4 differ",
    ),
    "fewer matrices": (
        member(inverse_binds, count=4),
        "/skins/0/inverseBindMatrices: expected 5 matrices, one a joint, found 4",
    ),
    "matrices transposed": (
        lambda glb: transpose(glb.array(inverse_binds(glb))),
        "/skins/0/inverseBindMatrices: expected matrices with last row 0 0 0 1; are they row-major?",
    ),
    "flat matrix": (
        lambda glb: glb.array(inverse_binds(glb)).__setitem__((1, slice(0, 3)), 0.0),
        "/skins/0/inverseBindMatrices: expected matrices that can be inverted, found 1",
    ),
    # animations
    "times out of order": (
        clock(lambda times: times.__setitem__(2, times[1])),
        "expected times [s] that increase strictly, found 1 keys not before the next (first at 1)",
    ),
    "negative time": (
        clock(lambda times: times.__isub__(0.5)),
        "expected times [s] from 0, found",
    ),
    "late start": (
        clock(lambda times: times.__iadd__(0.5)),
        "/animations/0: expected a first key at 0 s, found at 0.5 s",
    ),
    "rotation keys of another length": (
        output("rotation", lambda keys: keys.__imul__(np.float32(1.1))),
        "/animations/0/samplers/{rotation}/output: expected unit quaternions, found 4",
    ),
    "sign jump": (
        output("rotation", lambda keys: keys[2:].__imul__(np.float32(-1))),
        "/animations/0/samplers/{rotation}/output: expected quaternions on the side of those a "
        "key before, found 1 whose sign jumps (first at 1)",
    ),
    "dropped key": (
        member(sampler_index("translation", "output"), count=3),
        "/animations/0/samplers/{translation}/output: expected 4 values for 4 keys, found 3",
    ),
    "cubic keys": (
        lambda glb: glb.sampler("translation")[1].__setitem__("interpolation", "CUBICSPLINE"),
        "/animations/0/samplers/{translation}/output: expected 12 values for 4 keys, found 4",
    ),
    "interpolation": (
        lambda glb: glb.sampler("translation")[1].__setitem__("interpolation", "SMOOTH"),
        "/animations/0/samplers/{translation}/interpolation: expected LINEAR, STEP, CUBICSPLINE",
    ),
    "rotation as vectors": (
        member(sampler_index("rotation", "output"), type="VEC3"),
        "/animations/0/samplers/{rotation}/output: expected VEC4",
    ),
    "sampler that is none": (
        put(lambda j: j["animations"][0]["channels"][0], "sampler", 500),
        "/animations/0/channels/0/sampler: expected one of",
    ),
    "path": (
        put(lambda j: j["animations"][0]["channels"][0]["target"], "path", "color"),
        "/animations/0/channels/0/target/path: expected translation, rotation, scale, weights",
    ),
    "channel twice": (channel_twice, "/target: expected another target in each channel"),
    "moving matrix": (
        matrix_on_moving_node,
        "/target/node: expected a node with translation, rotation and scale, found one with a matrix",
    ),
    # splats
    "splats as triangles": (
        lambda glb: glb.primitive(SPLATS).__setitem__("mode", 4),
        "/primitives/0/mode: expected 0, points, found 4",
    ),
    "kernel": (
        put(splat_extension, "kernel", "box"),
        f"/extensions/{KHR}/kernel: expected ellipse, found 'box'",
    ),
    "color space": (
        drop(splat_extension, "colorSpace"),
        f"/extensions/{KHR}/colorSpace: expected srgb_rec709_display or",
    ),
    "extension that is no object": (
        lambda glb: glb.primitive(SPLATS)["extensions"].__setitem__(KHR, True),
        f"/extensions/{KHR}: expected an object, found True",
    ),
    "no opacities": (
        drop(splat_attributes, f"{KHR}:OPACITY"),
        f"/attributes/{KHR}:OPACITY: expected an accessor, found nothing",
    ),
    "missing harmonic": (
        drop(splat_attributes, f"{KHR}:SH_DEGREE_2_COEF_3"),
        "expected all 16 coefficients of SH degree 3, 0..3, found 15, without SH_DEGREE_2_COEF_3",
    ),
    "log scales": (
        attribute(SPLATS, f"{KHR}:SCALE", slice(None), -3.5),
        f"/attributes/{KHR}:SCALE: expected linear scales > 0, found 8 Gaussians with others",
    ),
    "logits": (
        attribute(SPLATS, f"{KHR}:OPACITY", 4, 1.25),
        f"/attributes/{KHR}:OPACITY: expected opacities in 0..1, found 1 Gaussians outside",
    ),
    "splat rotation": (
        attribute(SPLATS, f"{KHR}:ROTATION", 6, [1, 1, 0, 0]),
        f"/attributes/{KHR}:ROTATION: expected unit quaternions, found 1",
    ),
    "short splat attribute": (
        member(attribute_index(SPLATS, f"{KHR}:SCALE"), count=7),
        f"/attributes/{KHR}:SCALE: expected 8 values, as many as POSITION, found 7",
    ),
    "splat attribute type": (
        member(attribute_index(SPLATS, f"{KHR}:SH_DEGREE_1_COEF_0"), type="SCALAR"),
        f"/attributes/{KHR}:SH_DEGREE_1_COEF_0: expected VEC3 float32, found SCALAR float32",
    ),
    "extension not used": (
        lambda glb: glb.json["extensionsUsed"].remove(KHR),
        f"/extensionsUsed: expected {KHR}, found it is missing",
    ),
    "extension required": (
        put(lambda j: j, "extensionsRequired", [KHR]),
        f"/extensionsRequired: expected no {KHR}",
    ),
}
"""By name: what is done to a good file, and part of what must be said. `{rotation}` stands for the
number of the first sampler of rotations."""


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
