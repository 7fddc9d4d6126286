"""What the benchmarks of the exporters share: Markdown, fresh processes, reading splats back."""

import os
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def write_row(*cells: str) -> None:
    """Write one row of a Markdown table, at once: the next one may take minutes."""
    sys.stdout.write("| " + " | ".join(cells) + " |\n")
    sys.stdout.flush()


def write_head(*cells: str) -> None:
    """Write the head of a Markdown table."""
    sys.stdout.write("\n")
    write_row(*cells)
    write_row(*["---"] * len(cells))


def environment() -> dict[str, str]:
    """Return the environment of a process that finds this repository first."""
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def open_particle_field(path: Path) -> tuple[Any, Any]:
    """Return a stage, which must outlive it, and its only particle field."""
    from pxr import Usd, UsdVol

    stage = Usd.Stage.Open(str(path))
    (prim,) = [p for p in stage.Traverse() if p.IsA(UsdVol.ParticleField3DGaussianSplat)]
    return stage, UsdVol.ParticleField3DGaussianSplat(prim)
