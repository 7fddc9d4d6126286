"""Rules for nodes: the tree they form and the transforms they carry (glTF 2.0, section 3.5)."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from exporters.check import numbers
from exporters.check.problem import Problem

_LENGTHS = {"translation": 3, "rotation": 4, "scale": 3, "matrix": 16}


def parents_of(document: dict[str, Any]) -> dict[int, int]:
    """Return the parent of every node that has one; the last one wins."""
    nodes = document.get("nodes", [])
    return {child: index for index, node in enumerate(nodes) for child in node.get("children", [])}


def tree_problems(document: dict[str, Any]) -> Iterator[Problem]:
    """Every node has one parent at most, and is not above itself; scenes list roots (3.5.2)."""
    nodes = document.get("nodes", [])
    seen: dict[int, int] = {}
    for index, node in enumerate(nodes):
        for child in node.get("children", []):
            if child in seen:
                yield Problem(
                    place=f"/nodes/{index}/children",
                    expected="nodes with one parent",
                    found=f"node {child}, below node {seen[child]} too",
                )
            seen[child] = index
    parents = parents_of(document)
    for index in _on_cycles(parents):
        yield Problem(
            place=f"/nodes/{index}", expected="a tree", found="a node that is above itself"
        )
    for number, scene in enumerate(document.get("scenes", [])):
        for node in scene.get("nodes", []):
            if node in parents:
                yield Problem(
                    place=f"/scenes/{number}/nodes",
                    expected="nodes without a parent",
                    found=f"node {node}, a child of node {parents[node]}",
                )


def transform_problems(document: dict[str, Any]) -> Iterator[Problem]:
    """Transforms have their length, rotations unit length, and a matrix stands alone (3.5.3)."""
    for index, node in enumerate(document.get("nodes", [])):
        for member, length in _LENGTHS.items():
            if len(node.get(member, [0] * length)) != length:
                yield Problem(
                    place=f"/nodes/{index}/{member}",
                    expected=f"{length} numbers",
                    found=f"{len(node[member])}",
                )
            elif member == "rotation" and member in node:
                rotation = np.array([node[member]], np.float64)
                yield from numbers.unit_quaternions(f"/nodes/{index}/rotation", rotation)
        if "matrix" in node and {"translation", "rotation", "scale"} & set(node):
            yield Problem(
                place=f"/nodes/{index}",
                expected="a matrix, or translation, rotation and scale",
                found="both",
            )


def _on_cycles(parents: dict[int, int]) -> list[int]:
    """Return the nodes that are above themselves."""
    done: set[int] = set()
    found = []
    for start in parents:
        walk: dict[int, None] = {}
        node: int | None = start
        while node is not None and node not in done and node not in walk:
            walk[node] = None
            node = parents.get(node)
        if node in walk:
            path = list(walk)
            found += path[path.index(node) :]
        done.update(walk)
    return sorted(found)
