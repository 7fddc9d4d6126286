"""Rules for skins and the meshes they move (glTF 2.0, sections 3.7.3 and 5.28)."""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from exporters.check import influences
from exporters.check.gltf.accessors import Accessors
from exporters.check.gltf.meshes import type_problems
from exporters.check.gltf.tree import parents_of
from exporters.check.problem import Problem, count_bad

_MATRICES = {"MAT4 float32"}


def skin_problems(accessors: Accessors) -> Iterator[Problem]:
    """Every skin has distinct joints under one root, and a matrix for each."""
    parents = parents_of(accessors.json)
    for number, skin in enumerate(accessors.json.get("skins", [])):
        place = f"/skins/{number}"
        yield from joint_problems(f"{place}/joints", skin["joints"], parents)
        if "inverseBindMatrices" in skin:
            where = f"{place}/inverseBindMatrices"
            index = skin["inverseBindMatrices"]
            yield from type_problems(where, accessors, index, _MATRICES)
            if accessors.count(index) < len(skin["joints"]):
                yield Problem(
                    place=where,
                    expected=f"{len(skin['joints'])} matrices, one a joint",
                    found=str(accessors.count(index)),
                )
            matrices = accessors.raw(index)
            if matrices is not None and matrices.shape[1] == 16:
                yield from matrix_problems(where, matrices)


def joint_problems(place: str, joints: list[int], parents: dict[int, int]) -> Iterator[Problem]:
    """Joints are different nodes below one of them: tools want a single root joint."""
    if len(set(joints)) < len(joints) or not joints:
        found = f"{len(joints)}, of which {len(set(joints))} differ"
        yield Problem(place=place, expected="different nodes, at least one", found=found)
        return
    known = set(joints)
    roots = [joint for joint in joints if parents.get(joint) not in known]
    if len(roots) != 1:
        yield Problem(
            place=place,
            expected="one root joint",
            found=f"{len(roots)}, nodes {', '.join(map(str, roots[:5]))}",
        )


def matrix_problems(place: str, matrices: np.ndarray) -> Iterator[Problem]:
    """Inverse bind matrices are affine (5.28: the fourth row is 0, 0, 0, 1) and can be inverted.

    Args:
        place: Where they are.
        matrices: Column after column, shape (J, 16).
    """
    columns = matrices.reshape(-1, 4, 4)
    yield from count_bad(
        place,
        (columns[:, :, 3] != [0, 0, 0, 1]).any(axis=1),
        expected="matrices with last row 0 0 0 1; are they row-major?",
        what="matrices with another",
    )
    yield from count_bad(
        place,
        np.linalg.det(np.nan_to_num(columns[:, :3, :3].astype(np.float64))) == 0,
        expected="matrices that can be inverted",
        what="matrices that cannot",
    )


def influence_problems(accessors: Accessors) -> Iterator[Problem]:
    """Every skinned node's mesh has joints of that skin, and weights, for each vertex."""
    nodes = accessors.json.get("nodes", [])
    pairs = {(node["mesh"], node["skin"]) for node in nodes if "skin" in node and "mesh" in node}
    for number, node in enumerate(nodes):
        if "skin" in node and "mesh" not in node:
            yield Problem(place=f"/nodes/{number}", expected="a mesh to skin", found="none")
    for mesh, skin in sorted(pairs):
        joint_count = len(accessors.json["skins"][skin]["joints"])
        for index, primitive in enumerate(accessors.json["meshes"][mesh]["primitives"]):
            place = f"/meshes/{mesh}/primitives/{index}/attributes"
            yield from _primitive_problems(place, accessors, primitive, joint_count)


def _primitive_problems(
    place: str, accessors: Accessors, primitive: dict[str, Any], joint_count: int
) -> Iterator[Problem]:
    attributes = primitive["attributes"]
    sets = [*itertools.takewhile(lambda n: f"JOINTS_{n}" in attributes, itertools.count())]
    named = {name for name in attributes if name.startswith(("JOINTS_", "WEIGHTS_"))}
    if not sets or named != {f"{name}_{n}" for name in ("JOINTS", "WEIGHTS") for n in sets}:
        yield Problem(
            place=place,
            expected="JOINTS_0 and WEIGHTS_0, for the skin of the node",
            found=", ".join(sorted(named)) or "neither",
        )
        return
    joints = [accessors.raw(attributes[f"JOINTS_{n}"]) for n in sets]
    weights = [accessors.values(attributes[f"WEIGHTS_{n}"]) for n in sets]
    readable = [rows for rows in (*joints, *weights) if rows is not None]
    if len(readable) < 2 * len(sets) or len({rows.shape for rows in readable}) > 1:
        return  # said by the rules of accessors and attributes
    all_joints = np.concatenate(readable[: len(sets)], axis=1).astype(np.int32)
    all_weights = np.concatenate(readable[len(sets) :], axis=1)
    yield from influences.joint_indices(f"{place}/JOINTS_0", all_joints, joint_count)
    yield from influences.weights(f"{place}/WEIGHTS_0", all_weights)
    yield from influences.distinct_joints(f"{place}/JOINTS_0", all_joints, all_weights)
