"""What the benchmarks of the exporters share: Markdown, fresh processes, reading splats back."""

import os
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def table(rows: list[tuple[str, ...]]) -> str:
    """Return a Markdown table; the first row is its head."""
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    lines.insert(1, "|" + "---|" * len(rows[0]))
    return "\n".join(lines) + "\n\n"


def environment() -> dict[str, str]:
    """Return the environment of a process that finds this repository first."""
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def particle_field(path: Path) -> Any:
    """Return the only particle field of a stage."""
    from pxr import Usd, UsdVol

    stage = Usd.Stage.Open(str(path))
    (prim,) = [p for p in stage.Traverse() if p.IsA(UsdVol.ParticleField3DGaussianSplat)]
    field = UsdVol.ParticleField3DGaussianSplat(prim)
    field.stage = stage  # keeps it open
    return field
