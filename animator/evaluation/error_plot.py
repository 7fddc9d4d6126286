"""Errors over the frames as a small SVG that stands alone: one line a method."""

import html
import math
from collections.abc import Sequence

from animator.evaluation.benchmark import Row

_WIDTH, _HEIGHT = 640, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 52, 14, 40, 34
_COLORS = ("#4477AA", "#EE6677", "#228833", "#CCBB44", "#66CCEE", "#AA3377", "#EE7733", "#009988")
"""Paul Tol's "bright" and "vibrant" schemes (technical note SRON/EPS/TN/09-002)."""
_LINE_PX = 15


def error_plot(rows: Sequence[Row]) -> str:
    """Draw the mean error of every frame, a solid line a method, and its depth part dashed.

    Args:
        rows: Methods on one scene, at least one.
    """
    numbers = sorted({frame.number for row in rows for frame in row.scores.motion.frames})
    values = [
        frame.all.epe_percent
        for row in rows
        for frame in row.scores.motion.frames
        if math.isfinite(frame.all.epe_percent)
    ]
    top = max(values, default=0.0) or 1.0
    height = _HEIGHT + _LINE_PX * len(rows)
    first, last = numbers[0], numbers[-1]

    def place(number: int, value: float) -> str:
        across = (number - first) / max(last - first, 1)
        x = _LEFT + (_WIDTH - _LEFT - _RIGHT) * across
        y = _TOP + (_HEIGHT - _TOP - _BOTTOM) * (1.0 - value / top)
        return f"{x:.1f},{y:.1f}"

    title = f"{rows[0].scene}: mean error, % of the diagonal (dashed: along the camera's ray)"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" '
        'font-family="sans-serif" font-size="12" fill="none">',
        f'<rect width="{_WIDTH}" height="{height}" fill="#fff"/>',
        f'<text x="{_LEFT}" y="22" fill="#222">{html.escape(title)}</text>',
    ]
    for value in (0.0, top / 2, top):
        y = place(first, value).partition(",")[2]
        parts.append(f'<path d="M{_LEFT} {y}H{_WIDTH - _RIGHT}" stroke="#ddd"/>')
        parts.append(
            f'<text x="{_LEFT - 6}" y="{y}" dy="4" text-anchor="end" fill="#555">{value:.3g}</text>'
        )
    for number, anchor in ((first, "start"), (last, "end")):
        x = place(number, 0.0).partition(",")[0]
        parts.append(
            f'<text x="{x}" y="{_HEIGHT - _BOTTOM + 18}" text-anchor="{anchor}" fill="#555">'
            f"frame {number}</text>"
        )
    for index, row in enumerate(rows):
        color = _COLORS[index % len(_COLORS)]
        frames = row.scores.motion.frames
        lines = {"": "epe_percent", ' stroke-dasharray="4 4"': "depth_percent"}
        for dashes, field in lines.items():
            points = [
                place(frame.number, getattr(frame.all, field))
                for frame in frames
                if math.isfinite(getattr(frame.all, field))
            ]
            parts.append(
                f'<polyline points="{" ".join(points)}" stroke="{color}" stroke-width="2"{dashes}/>'
            )
        y = _HEIGHT + _LINE_PX * index
        parts.append(f'<path d="M{_LEFT} {y - 4}h24" stroke="{color}" stroke-width="2"/>')
        label = f"{row.method}: {row.scores.motion.all.epe_percent:.2f} %"
        parts.append(f'<text x="{_LEFT + 32}" y="{y}" fill="#222">{html.escape(label)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"
