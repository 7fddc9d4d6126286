"""The report for programs."""

import dataclasses
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from animator.report.record import RunRecord

FORMAT_NAME = "splatimate-report"
FORMAT_VERSION = 1
"""Rises when a key changes its meaning or goes away; new keys may come without."""
_DIGITS = 6


def json_report(record: RunRecord) -> str:
    """Write a report as JSON.

    Numbers have six significant digits; what could not be measured (NaN) is null.
    """
    document = {"format": FORMAT_NAME, "version": FORMAT_VERSION, **plain(record)}
    document["frames"] = [_row(row) for row in document.pop("rows")]
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _row(row: dict[str, Any]) -> dict[str, Any]:
    """Lay the figures of a frame flat, so that the frames read as a table."""
    flat = {key: value for key, value in row.items() if key not in ("quality", "seconds")}
    return {**flat, **row["quality"], "seconds": row["seconds"]}


def plain(value: Any) -> Any:
    """Return what JSON can hold: dataclasses as mappings, NaN as null, six digits."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
    return value
