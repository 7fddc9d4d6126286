"""Each rule for skins, animations and splats catches a .glb broken in that one way."""

from pathlib import Path

import numpy as np
import pytest

from exporters.check import check_file
from tests.check.glb_edits import (
    KHR,
    MESH,
    SPLATS,
    Edit,
    attribute,
    attribute_index,
    channel_twice,
    clock,
    drop,
    good_glb,
    inverse_binds,
    matrix_on_moving_node,
    member,
    output,
    put,
    repeat_joint,
    sampler_index,
    second_root,
    splat_attributes,
    splat_extension,
    transpose,
)
from tests.check.glb_file import GlbFile

EDITS: dict[str, tuple[Edit, str]] = {
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
