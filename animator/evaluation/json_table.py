"""The tables for programs, as JSON: everything that was measured."""

import json
from collections.abc import Sequence
from typing import Any

from animator.evaluation.benchmark import Row
from animator.evaluation.figures import by_method, figures_of, mean_figures
from animator.report.json_report import plain

FORMAT_NAME = "splatimate-evaluation"
FORMAT_VERSION = 1
"""Rises when a key changes its meaning or goes away; new keys may come without."""


def json_table(task: str, rows: Sequence[Row], notes: Sequence[str], code: str) -> str:
    """Write the results of one task.

    Args:
        task: Key of `TASKS`.
        rows: The rows, scene after scene.
        notes: What is missing, and why.
        code: Digest of the code that made them.
    """
    document = {
        "format": FORMAT_NAME,
        "version": FORMAT_VERSION,
        "task": task,
        "code": code,
        "notes": list(notes),
        "means": {
            name: {"scenes": len(members), **mean_figures(members)}
            for name, members in by_method(rows).items()
        },
        "results": [_result(row) for row in rows],
    }
    return json.dumps(plain(document), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _result(row: Row) -> dict[str, Any]:
    return {
        "scene": row.scene,
        "method": row.method,
        "gaussians": row.gaussians,
        "scored_frames": list(row.scored_numbers),
        **figures_of(row),
        "frames": row.scores.motion.frames,
        "parts": row.scores.motion.parts,
        "views": row.scores.views,
    }
