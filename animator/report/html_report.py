"""The report for people: one HTML file that needs nothing else, on line or on disk."""

import base64
import html
import math
from collections.abc import Iterable, Mapping
from typing import Any

from animator.report.chart import Chart, chart_svg
from animator.report.record import FrameRow, RunRecord, Summary

_STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #8882; --accent: #3b76c4; }
* { box-sizing: border-box; }
body { font: 15px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 1280px; padding: 24px; }
h1 { margin: 0; } h2 { margin: 36px 0 10px; font-size: 19px; }
p { margin: 6px 0; max-width: 80ch; }
.verdict { display: inline-block; padding: 2px 12px; border-radius: 12px; color: #fff; }
.good { background: #27834b; } .bad { background: #b3412f; }
.tiles { display: flex; flex-wrap: wrap; gap: 10px; margin: 18px 0; }
.tile { background: var(--soft); border-radius: 8px; padding: 10px 16px; min-width: 150px; }
.tile b { display: block; font-size: 22px; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(280px, 1fr)); gap: 18px; }
figure { margin: 0; } figcaption { font-weight: 600; }
svg { width: 100%; height: auto; } svg text { font-size: 11px; fill: currentColor; opacity: .75; }
svg .grid { stroke: var(--line); } svg .threshold { stroke: #b3412f; stroke-dasharray: 5 4; }
svg polyline { fill: none; stroke: var(--accent); stroke-width: 2; }
svg circle { fill: var(--accent); } svg .upper { opacity: .4; }
img { max-width: 100%; border-radius: 6px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 3px 9px; border-bottom: 1px solid var(--line); text-align: right; }
th { white-space: nowrap; vertical-align: bottom; }
th:first-child, td:first-child, .text td { text-align: left; }
details > summary { cursor: pointer; font-weight: 600; margin: 12px 0 6px; }
"""

_COLUMNS = (
    "frame", "matches", "reprojection px", "PSNR dB", "silhouette IoU", "rigid residual %",
    "skin error %", "unseen %", "never seen %", "± along ray %", "± across %", "groups", "start",
    "seconds",
)  # fmt: skip

_EXPLANATIONS = (
    ("PSNR", "of the render against the frame, inside the union of both silhouettes, on black."),
    ("Silhouette IoU", "overlap of the render's outline with the frame's; 1 is perfect."),
    ("Rigid residual", "how far rigid groups are from moving rigidly, in % of the diagonal."),
    (
        "Skin error",
        "largest distance between the exported skin and the optimized Gaussians, in % of the "
        "diagonal.",
    ),
    (
        "Unseen",
        "opacity-weighted share of Gaussians hidden in this frame; never seen: hidden in all "
        "frames so far, so that their motion is extrapolated. What moves along the line of sight "
        "is not observed by one camera either.",
    ),
    (
        "Uncertainty (±)",
        "how well the matches of the frame determine where the anchors are, along the viewing ray "
        "and across it: standard deviation in % of the diagonal, median and 95th percentile of the "
        "anchors. Large where nothing was seen. It knows the noise of the matches, not mistakes.",
    ),
)


def html_report(record: RunRecord, contact_sheet_png: bytes) -> str:
    """Write a report as one HTML page.

    Args:
        record: What to show; every text in it is escaped.
        contact_sheet_png: The contact sheet, embedded.
    """
    name = html.escape(record.name)
    picture = base64.b64encode(contact_sheet_png).decode("ascii")
    body = [
        f"<h1>{name}</h1>",
        _verdict(record.summary),
        _tiles(record),
        "<h2>Pictures</h2>",
        f'<img alt="frames, renders, differences, groups" src="data:image/png;base64,{picture}">',
        "<h2>Frame by frame</h2>",
        _charts(record),
        _table(record.rows),
        "<h2>What the figures mean</h2>",
        *(f"<p><b>{term}</b>: {text}</p>" for term, text in _EXPLANATIONS),
        "<h2>How it was made</h2>",
        *(f"<p>{html.escape(choice)}</p>" for choice in record.choices),
        _details("Inputs", record.inputs),
        _details("Settings", record.settings),
        _details("Seconds", {key: f"{value:.1f}" for key, value in record.seconds.items()}),
        _details("Versions", record.versions),
        _details("Files", dict.fromkeys(record.outputs, "")),
    ]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name} - Splatimate report</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


def _verdict(summary: Summary) -> str:
    kind, word = ("good", "passed") if summary.is_good else ("bad", "failed")
    return (
        f'<p><span class="verdict {kind}">quality gate {word}</span> mean silhouette IoU '
        f"{_number(summary.mean_silhouette_iou, 3)}, wanted {summary.min_iou:g} or more</p>"
    )


def _tiles(record: RunRecord) -> str:
    summary = record.summary
    tiles = (
        ("frames", str(summary.frames)),
        ("mean PSNR", f"{_number(summary.mean_psnr_db, 1)} dB"),
        ("mean silhouette IoU", _number(summary.mean_silhouette_iou, 3)),
        ("lowest silhouette IoU", _number(summary.lowest_silhouette_iou, 3)),
        ("largest skin error", _percent(summary.largest_skin_error_percent)),
        ("never seen", f"{_number(100 * summary.never_seen_share, 0)} %"),
        ("total time", f"{sum(record.seconds.values()):.0f} s"),
    )
    inner = "".join(f'<div class="tile"><b>{value}</b>{label}</div>' for label, value in tiles)
    return f'<div class="tiles">{inner}</div>'


def _charts(record: RunRecord) -> str:
    rows = record.rows
    numbers = tuple(row.number for row in rows)
    charts = (
        Chart(
            title="PSNR in the silhouettes [dB]",
            values=tuple(row.quality.psnr_db for row in rows),
            labels=numbers,
        ),
        Chart(
            title="Silhouette IoU",
            values=tuple(row.quality.silhouette_iou for row in rows),
            labels=numbers,
            low=0.0,
            high=1.0,
            threshold=record.summary.min_iou,
        ),
        Chart(
            title="Matches",
            values=tuple(float(row.matches) for row in rows),
            labels=numbers,
            low=0.0,
        ),
        Chart(
            title="Reprojection error [px]",
            values=tuple(row.reprojection_px for row in rows),
            labels=numbers,
            low=0.0,
        ),
        *(
            Chart(
                title=f"Uncertainty {direction} the ray, median and 95 % [% of the diagonal]",
                values=tuple(spread.median for spread in spreads),
                upper=tuple(spread.p95 for spread in spreads),
                labels=numbers,
                low=0.0,
            )
            for direction, spreads in (
                ("along", [row.quality.uncertainty_along_percent for row in rows]),
                ("across", [row.quality.uncertainty_across_percent for row in rows]),
            )
        ),
    )
    figures = "".join(
        f"<figure><figcaption>{html.escape(chart.title)}</figcaption>{chart_svg(chart)}</figure>"
        for chart in charts
    )
    return f'<div class="charts">{figures}</div>'


def _table(rows: Iterable[FrameRow]) -> str:
    head = "".join(f"<th>{column}</th>" for column in _COLUMNS)
    body = "".join(f"<tr>{''.join(_cells(row))}</tr>" for row in rows)
    return (
        "<details open><summary>All frames</summary><div class='scroll'>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div></details>"
    )


def _cells(row: FrameRow) -> Iterable[str]:
    quality = row.quality
    values = (
        f'<span title="{html.escape(row.name, quote=True)}">{row.number}</span>',
        str(row.matches),
        _number(row.reprojection_px, 2),
        _number(quality.psnr_db, 2),
        _number(quality.silhouette_iou, 3),
        _number(quality.rigid_residual_percent, 3),
        _number(quality.skin_error_percent, 5),
        _number(100 * quality.unseen_share, 0),
        _number(100 * quality.never_seen_share, 0),
        _number(quality.uncertainty_along_percent.median, 2),
        _number(quality.uncertainty_across_percent.median, 2),
        str(row.groups),
        html.escape(row.start),
        _number(sum(row.seconds.values()), 1),
    )
    return (f"<td>{value}</td>" for value in values)


def _details(title: str, values: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<tr><td>{html.escape(str(key))}</td><td>{html.escape(_text(value))}</td></tr>"
        for key, value in values.items()
    )
    return (
        f"<details><summary>{html.escape(title)}</summary>"
        f'<table class="text">{rows}</table></details>'
    )


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value)) or "none"
    return "none" if value is None else str(value)


def _percent(value: float) -> str:
    return "&lt; 0.001 %" if value < 0.001 else f"{_number(value, 3)} %"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "&ndash;"
