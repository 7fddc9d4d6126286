"""A folder of PLY files in plain data, read by the plyfile package."""

from pathlib import Path

import numpy as np

from tests.golden.semantics import fix_signs, plain


def dump(folder: Path) -> dict:
    """Describe every file of a sequence: columns in order, and one row a Gaussian."""
    return plain({path.name: _frame(path) for path in sorted(folder.iterdir())})


def _frame(path: Path) -> dict:
    from plyfile import PlyData

    ply = PlyData.read(path)
    (element,) = ply.elements
    names = [each.name for each in element.properties]
    rows = np.stack([element[name].astype(np.float64) for name in names], axis=1)
    rotation = [names.index(f"rot_{i}") for i in range(4)]
    rows[:, rotation] = fix_signs(rows[:, rotation])
    return {
        "format": "text" if ply.text else f"binary{ply.byte_order}",
        "element": element.name,
        "columns": [f"{each.val_dtype} {each.name}" for each in element.properties],
        "rows": rows,
    }
