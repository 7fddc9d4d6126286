"""Small line charts as inline SVG."""

import dataclasses
import html
import math
from collections.abc import Sequence

_WIDTH = 420
_HEIGHT = 150
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 12, 12, 24


@dataclasses.dataclass(frozen=True, kw_only=True)
class Chart:
    """One quantity over the frames."""

    title: str
    values: tuple[float, ...]
    """One a frame; NaN leaves a gap."""
    labels: tuple[int, ...]
    """Frame numbers."""
    upper: tuple[float, ...] = ()
    """A second quantity on the same axis, drawn faintly, one a frame; none if empty."""
    low: float | None = None
    """Lower end of the axis, None for the smallest value."""
    high: float | None = None
    """Upper end of the axis, None for the largest value."""
    threshold: float | None = None
    """Value to mark with a dashed line."""


def chart_svg(chart: Chart) -> str:
    """Draw a chart; all text is escaped, nothing is referenced."""
    low, high = _limits(chart)
    points = _points(chart.values, low, high)
    parts = [
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'aria-label="{html.escape(chart.title, quote=True)}">'
    ]
    for value in (low, (low + high) / 2, high):
        y = _y(value, low, high)
        parts.append(f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y}" y2="{y}"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 4}" text-anchor="end">{_tick(value)}</text>')
    if chart.threshold is not None and low <= chart.threshold <= high:
        y = _y(chart.threshold, low, high)
        parts.append(
            f'<line class="threshold" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y}" y2="{y}"/>'
        )
    for kind, line in (("upper", _points(chart.upper, low, high)), ("main", points)):
        for stretch in _stretches(line):
            path = " ".join(f"{x},{y}" for x, y, _ in stretch)
            parts.append(f'<polyline class="{kind}" points="{path}"/>')
    for (x, y, value), label in zip(points, chart.labels, strict=True):
        if math.isfinite(value):
            title = f"<title>frame {label}: {value:.4g}</title>"
            parts.append(f'<circle cx="{x}" cy="{y}" r="2.5">{title}</circle>')
    for index, anchor in ((0, "start"), (len(points) - 1, "end")):
        if points and (index or len(points) == 1 or anchor == "start"):
            x = points[index][0]
            parts.append(
                f'<text x="{x}" y="{_HEIGHT - 6}" text-anchor="{anchor}">'
                f"{chart.labels[index]}</text>"
            )
    parts.append("</svg>")
    return "".join(parts)


def _points(values: Sequence[float], low: float, high: float) -> list[tuple[float, float, float]]:
    """Place values in the picture: x, y, value."""
    return [
        (_x(index, len(values)), _y(value, low, high), value) for index, value in enumerate(values)
    ]


def _limits(chart: Chart) -> tuple[float, float]:
    """Return the ends of the axis, apart from each other."""
    finite = [value for value in (*chart.values, *chart.upper) if math.isfinite(value)] or [0.0]
    low = min(finite) if chart.low is None else chart.low
    high = max(finite) if chart.high is None else chart.high
    return (low, high) if high - low > 1e-9 else (low, low + 1.0)


def _tick(value: float) -> str:
    """Write a number of an axis: three digits, but never an exponent for counts."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _x(index: int, count: int) -> float:
    return round(_LEFT + (_WIDTH - _LEFT - _RIGHT) * index / max(count - 1, 1), 1)


def _y(value: float, low: float, high: float) -> float:
    if not math.isfinite(value):
        return 0.0
    share = min(max((value - low) / (high - low), 0.0), 1.0)
    return round(_TOP + (_HEIGHT - _TOP - _BOTTOM) * (1.0 - share), 1)


def _stretches(
    points: Sequence[tuple[float, float, float]],
) -> list[list[tuple[float, float, float]]]:
    """Split the line where values are missing."""
    stretches: list[list[tuple[float, float, float]]] = [[]]
    for point in points:
        if math.isfinite(point[2]):
            stretches[-1].append(point)
        elif stretches[-1]:
            stretches.append([])
    return [stretch for stretch in stretches if len(stretch) > 1]
