"""Names that USD accepts, from names that people give."""

import re
from collections.abc import Sequence


def identifier(name: str) -> str:
    """Return a valid prim name: as `Tf.MakeValidIdentifier`, ASCII letters, digits, underscores."""
    ascii_name = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return ascii_name if re.match(r"[A-Za-z_]", ascii_name) else f"_{ascii_name}"


def unique_identifiers(names: Sequence[str]) -> list[str]:
    """Return valid prim names, all different, where "a b" and "a_b" would become one."""
    taken: set[str] = set()
    unique = []
    for name in names:
        candidate = base = identifier(name)
        number = 2
        while candidate in taken:
            candidate = f"{base}_{number}"
            number += 1
        taken.add(candidate)
        unique.append(candidate)
    return unique


def joint_paths(names: Sequence[str], parents: Sequence[int]) -> list[str]:
    """Return UsdSkel joint paths, `root/arm/hand`, whose last parts are unique as Blender needs.

    Args:
        names: Joint names, parents before children.
        parents: Index of each joint's parent, -1 for the root.
    """
    paths: list[str] = []
    for leaf, parent in zip(unique_identifiers(names), parents, strict=True):
        paths.append(leaf if parent < 0 else f"{paths[parent]}/{leaf}")
    return paths
