"""Ways to break one thing in a .glb."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from exporters import export_clip
from tests.check.glb_file import GlbFile
from tests.helpers import clips

Edit = Callable[[GlbFile], object]
MESH, SPLATS = "carrier", "rest_splats"
KHR = "KHR_gaussian_splatting"


def good_glb(folder: Path) -> Path:
    """Write a file with all that there is to break: 8 Gaussians, 5 joints, 4 keys, SH degree 3."""
    export_clip(clips.random(gaussians=8, joints=5, keys=4), folder / "clip.glb")
    return folder / "clip.glb"


def attribute(node: str, name: str, index: object, value: object) -> Edit:
    """Overwrite some numbers of an attribute."""
    return lambda glb: glb.attribute(node, name).__setitem__(index, value)


def output(path: str, change: Callable[[np.ndarray], None]) -> Edit:
    """Change the key values of the first channel of a property."""
    return lambda glb: change(glb.array(glb.sampler(path)[1]["output"]))


def clock(change: Callable[[np.ndarray], None]) -> Edit:
    """Change the key times, and their bounds with them."""

    def edit(glb: GlbFile) -> None:
        index = glb.sampler("rotation")[1]["input"]
        times = glb.array(index)
        change(times)
        glb.json["accessors"][index] |= {"min": [float(times.min())], "max": [float(times.max())]}

    return edit


def member(accessor_of: Callable[[GlbFile], int], **values: object) -> Edit:
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
