import dataclasses
import json
import math
import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser

import pytest

from animator.report.chart import Chart, chart_svg
from animator.report.html_report import html_report
from animator.report.json_report import json_report
from animator.report.record import summarize

ROW_TYPES = {
    "number": int,
    "name": str,
    "time_s": float,
    "matches": int,
    "reprojection_px": float | None,
    "start": str,
    "groups": int,
    "psnr_db": float | None,
    "silhouette_iou": float,
    "rigid_residual_percent": float | None,
    "skin_error_percent": float,
    "unseen_share": float,
    "never_seen_share": float,
    "uncertainty_along_percent": dict,
    "uncertainty_across_percent": dict,
    "seconds": dict,
}
DOCUMENT_TYPES = {
    "format": str,
    "version": int,
    "name": str,
    "inputs": dict,
    "choices": list,
    "settings": dict,
    "versions": dict,
    "outputs": list,
    "seconds": dict,
    "summary": dict,
    "frames": list,
}


def forbid_constant(name: str):
    raise AssertionError(f"{name} is not JSON")


def test_json_has_the_promised_keys_and_types(record):
    document = json.loads(json_report(record), parse_constant=forbid_constant)
    assert {key: type(value) for key, value in document.items()} == DOCUMENT_TYPES
    assert (document["format"], document["version"]) == ("splatimate-report", 1)
    for row in document["frames"]:
        assert list(row) == list(ROW_TYPES)
        for key, kind in ROW_TYPES.items():
            assert isinstance(row[key], kind), key
    assert document["frames"][0]["reprojection_px"] is None
    spreads = [row["uncertainty_along_percent"] for row in document["frames"]]
    assert spreads == [{"median": None, "p95": None}, *[{"median": 0.5, "p95": 2.0}] * 2]
    assert document["summary"]["is_good"] is True


def test_the_summary_by_hand(record):
    summary = record.summary
    assert summary.mean_silhouette_iou == pytest.approx((0.9 + 0.7 + 0.5) / 3)
    assert summary.lowest_silhouette_iou == pytest.approx(0.5)
    assert summary.mean_psnr_db == 20.0  # the frame without a PSNR does not count
    assert summary.never_seen_share == 0.25


@pytest.mark.parametrize(("min_iou", "is_good"), [(0.7, True), (0.71, False), (0.0, True)])
def test_the_gate_is_the_mean_overlap(record, min_iou, is_good):
    qualities = [
        dataclasses.replace(row.quality, silhouette_iou=iou)
        for row, iou in zip(record.rows, (0.6, 0.7, 0.8), strict=True)
    ]
    assert summarize(qualities, min_iou=min_iou).is_good is is_good


class _Page(HTMLParser):
    """Collects what a browser would act on."""

    VOID = frozenset({"meta", "img"})

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.links += [value for key, value in attrs if key in ("src", "href", "srcset", "action")]
        self.links += [key for key, _ in attrs if key.startswith("on")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def read_page(page: str) -> _Page:
    parser = _Page()
    parser.feed(page)
    parser.close()
    return parser


def test_html_needs_nothing_and_escapes_everything(record):
    page = html_report(record, b"png")
    parsed = read_page(page)
    assert parsed.open == []
    assert "script" not in parsed.tags
    assert parsed.links == ["data:image/png;base64,cG5n"]
    assert "url(" not in page
    assert "@import" not in page
    # The hostile text is shown as text wherever it is shown.
    assert parsed.text.count('<script src="https://evil.example/x.js">') >= 6


def test_a_plain_report_mentions_no_address(record):
    plain = html_report(
        dataclasses.replace(record, name="a", choices=(), settings={}, outputs=(), rows=()), b""
    )
    assert not re.search(r"https?:|//[a-z]", plain)


def test_html_tells_the_verdict(record):
    assert "quality gate passed" in html_report(record, b"")
    failed = dataclasses.replace(record.summary, is_good=False)
    page = html_report(dataclasses.replace(record, summary=failed), b"")
    assert "quality gate failed" in page


def svg_of(*values: float, **options) -> ElementTree.Element:
    labels = tuple(range(len(values)))
    return ElementTree.fromstring(
        chart_svg(Chart(title="a < b & c", values=values, labels=labels, **options))
    )


def test_a_chart_breaks_its_line_where_values_are_missing():
    svg = svg_of(1.0, 2.0, math.nan, 3.0, 4.0, math.nan, 5.0)
    assert len(svg.findall("polyline")) == 2
    assert len(svg.findall("circle")) == 5
    assert svg.get("aria-label") == "a < b & c"


def test_a_second_line_shares_the_axis_of_the_first():
    svg = svg_of(1.0, 2.0, upper=(4.0, 8.0))
    upper, main = svg.findall("polyline")
    assert (upper.get("class"), main.get("class")) == ("upper", "main")
    heights = [
        float(pair.split(",")[1])
        for pair in (upper.get("points") + " " + main.get("points")).split()
    ]
    # 8 is the top, 1 the bottom, and 4 and 2 lie three and one sevenths up.
    top, bottom = heights[1], heights[2]
    assert heights[0] == pytest.approx(bottom + (top - bottom) * 3 / 7, abs=0.1)
    assert heights[3] == pytest.approx(bottom + (top - bottom) * 1 / 7, abs=0.1)


def test_a_chart_puts_larger_values_higher():
    svg = svg_of(0.0, 1.0, low=0.0, high=1.0, threshold=0.5)
    first, last = (float(circle.get("cy")) for circle in svg.findall("circle"))
    (threshold,) = svg.findall("line[@class='threshold']")
    assert last < float(threshold.get("y1")) < first


def test_a_chart_writes_thousands_without_exponent():
    texts = [text.text for text in svg_of(0.0, 1430.0).findall("text")]
    assert texts[:3] == ["0", "715", "1,430"]


@pytest.mark.parametrize("values", [(), (1.0,), (math.nan,), (2.0, 2.0), (math.inf, 1.0)])
def test_a_chart_of_odd_values_is_still_a_picture(values):
    svg = svg_of(*values)
    assert "nan" not in ElementTree.tostring(svg, encoding="unicode")
