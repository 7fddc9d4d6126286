"""The tables for people, as Markdown."""

import math
from collections.abc import Mapping, Sequence

from animator.evaluation.benchmark import LINEAR, Row
from animator.evaluation.figures import FIGURES, by_method, figures_of, mean_figures
from animator.evaluation.methods import METHODS
from animator.evaluation.tasks import TASKS

_LEGEND = """\
*captured* is 1 - sum of errors / sum of true motion over outer points of the surface: 1 is perfect,
0 is the model left at rest; *seen*, *unseen*: of points while the clip's camera sees them or not.
*error* is the mean distance from the true place in % of the object's diagonal, *lateral* and *depth*
its parts across and along the ray of the clip's camera. *bent* is how far rigid parts are from rigid,
in % of the diagonal. *jitter* compares accelerations with the true ones: 1 is as smooth. PSNR [dB]
(inside the silhouettes; *full*: of the whole picture), SSIM, FLIP, LPIPS and silhouette IoU are of
held-out views, *front* of the clip's own. *rank* is Spearman's correlation of claimed uncertainty
and true error. A dash: not measured."""


def markdown_table(task: str, rows: Sequence[Row], notes: Sequence[str] = ()) -> str:
    """Write the tables of one task: every scene, the means, and the parts of the last method.

    Args:
        task: Key of `TASKS`.
        rows: At least one, scene after scene.
        notes: What is missing, and why.
    """
    lines = [f"# {task}: {TASKS[task].summary}", ""]
    lines += _table(
        ("scene", "method"), [((row.scene, row.method), figures_of(row)) for row in rows]
    )
    methods = by_method(rows)
    scenes = list(dict.fromkeys(row.scene for row in rows))
    if len(scenes) > 1:
        means = [
            ((f"mean of {len(members)}", name), mean_figures(members))
            for name, members in methods.items()
        ]
        lines += ["", *_table(("scenes", "method"), means)]
    lines += ["", _LEGEND, ""]
    lines += [f"- `{name}`: {_summary(name)}" for name in methods]
    lines += [f"- {note}" for note in notes]
    lines += _parts(rows, list(methods)[-1])
    return "\n".join(lines) + "\n"


def _table(heads: tuple[str, str], rows: Sequence[tuple[tuple[str, str], Mapping]]) -> list[str]:
    """Write rows of figures; columns that nobody could measure are left out."""
    keys = [key for key in FIGURES if any(math.isfinite(figures[key]) for _, figures in rows)]
    lines = [_line((*heads, *(FIGURES[key].title for key in keys)))]
    lines.append("|---|---|" + "---:|" * len(keys))
    for names, figures in rows:
        lines.append(_line((*names, *(_number(figures[key], FIGURES[key].digits) for key in keys))))
    return lines


def _parts(rows: Sequence[Row], method: str) -> list[str]:
    """Write the errors by part of one method, the worst parts of each scene first."""
    lines = []
    for row in rows:
        parts = row.scores.motion.parts
        if row.method != method or len(parts) < 2:
            continue
        lines += ["", f"## Parts of {row.scene}, {method}", ""]
        lines.append(
            _line(("part", "points", "captured", "error %", "lateral %", "depth %", "bent %"))
        )
        lines.append("|---|" + "---:|" * 6)
        for part in sorted(parts, key=lambda part: -part.all.epe_percent):
            errors = part.all
            shown = (
                _number(errors.captured, 3),
                _number(errors.epe_percent, 2),
                _number(errors.lateral_percent, 2),
                _number(errors.depth_percent, 2),
                _number(part.rigid_error_percent, 3),
            )
            lines.append(_line((part.name, str(part.points), *shown)))
    return lines


def _summary(method: str) -> str:
    if method in METHODS:
        return METHODS[method].summary
    if method.endswith(f"-{LINEAR}"):
        return "the same keys, joints interpolated linearly between them"
    return "a result that was there already"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _number(value: float, digits: int) -> str:
    return f"{value:z.{digits}f}" if math.isfinite(value) else "-"
