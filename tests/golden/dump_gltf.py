"""A glTF file in plain data: indices resolved to names, buffers to numbers, the skin played."""

from pathlib import Path

import numpy as np

from tests.golden.semantics import fix_signs, is_sign_continuous, plain
from tests.helpers import gltf_reader
from tests.helpers.gltf_reader import GltfFile

COMPONENTS = {5121: "uint8", 5123: "uint16", 5125: "uint32", 5126: "float32"}
MODES = {0: "POINTS", 4: "TRIANGLES"}


def dump(path: Path, moments_s: list[float]) -> dict:
    """Describe a file written by the exporter.

    Args:
        path: A .glb or .gltf.
        moments_s: Times [s] at which to play the carrier.
    """
    file = gltf_reader.read(path)
    document = file.json
    names = [node["name"] for node in document["nodes"]]
    described = {
        "version": document["asset"]["version"],
        "default_scene": document["scenes"][document["scene"]]["name"],
        "extensions_used": document.get("extensionsUsed", []),
        "extensions_required": document.get("extensionsRequired", []),
        "scenes": {
            scene["name"]: [names[i] for i in scene["nodes"]] for scene in document["scenes"]
        },
        "nodes": {node["name"]: _node(file, node) for node in document["nodes"]},
        "meshes": {
            mesh["name"]: [_primitive(file, primitive) for primitive in mesh["primitives"]]
            for mesh in document.get("meshes", [])
        },
        "materials": document.get("materials", []),
        "skins": {skin["name"]: _skin(file, skin) for skin in document["skins"]},
        "cameras": document.get("cameras", []),
        "animations": [_animation(file, each) for each in document.get("animations", [])],
        "played_carrier": [
            {"time_s": time_s, "positions": file.skinned_positions("carrier", time_s)}
            for time_s in moments_s
        ],
    }
    return plain(described)


def _node(file: GltfFile, node: dict) -> dict:
    document = file.json
    described = {key: node[key] for key in ("translation", "scale", "matrix") if key in node}
    if "rotation" in node:
        described["rotation_xyzw"] = fix_signs(np.array(node["rotation"]))
    described["children"] = [document["nodes"][i]["name"] for i in node.get("children", [])]
    for key, collection in (("mesh", "meshes"), ("skin", "skins"), ("camera", "cameras")):
        if key in node:
            described[key] = document[collection][node[key]]["name"]
    return described


def _accessor(file: GltfFile, index: int) -> dict:
    accessor = file.json["accessors"][index]
    values = file.accessor(index)
    is_integer = accessor["componentType"] != 5126 and not accessor["normalized"]
    described = {
        "component": COMPONENTS[accessor["componentType"]],
        "element": accessor["type"],
        "normalized": accessor["normalized"],
        "count": accessor["count"],
        "values": values.astype(int) if is_integer else values,
    }
    return described | {key: accessor[key] for key in ("min", "max") if key in accessor}


def _primitive(file: GltfFile, primitive: dict) -> dict:
    attributes = {name: _accessor(file, i) for name, i in primitive["attributes"].items()}
    for name, attribute in attributes.items():
        if name.endswith(":ROTATION"):
            attribute["values"] = fix_signs(attribute["values"])
    described = {
        "mode": MODES[primitive["mode"]],
        "material": file.json["materials"][primitive["material"]]["name"],
        "attributes": attributes,
        "extensions": primitive.get("extensions", {}),
    }
    if "indices" in primitive:
        described["indices"] = _accessor(file, primitive["indices"])
    return described


def _skin(file: GltfFile, skin: dict) -> dict:
    names = [node["name"] for node in file.json["nodes"]]
    return {
        "skeleton": names[skin["skeleton"]],
        "joints": [names[i] for i in skin["joints"]],
        "inverse_bind_matrices": _accessor(file, skin["inverseBindMatrices"]),
    }


def _animation(file: GltfFile, animation: dict) -> dict:
    channels = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        described = _accessor(file, sampler["output"])
        described["interpolation"] = sampler["interpolation"]
        described["times_s"] = file.accessor(sampler["input"])[:, 0]
        if channel["target"]["path"] == "rotation":
            described["sign_continuous"] = is_sign_continuous(described["values"])
            described["values"] = fix_signs(described["values"])
        node = file.json["nodes"][channel["target"]["node"]]["name"]
        channels[f"{node}.{channel['target']['path']}"] = described
    return {
        "name": animation["name"],
        "extras": animation.get("extras", {}),
        "clock_count": len({sampler["input"] for sampler in animation["samplers"]}),
        "channels": channels,
    }
