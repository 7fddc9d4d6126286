"""Plain data that means the same on every machine: rounded, sorted, written one fact a line."""

import json

import numpy as np

DIGITS = 6
NOISE = 1e-9
"""Values below are rounding noise of some processor, and written as zero."""

Json = dict | list | str | int | float | bool | None


def plain(value: object) -> Json:
    """Convert numbers, arrays and containers to JSON types; floats to six significant digits."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return 0.0 if abs(value) < NOISE else float(f"{value:.{DIGITS}g}")
    if value is None or isinstance(value, bool | int | str):
        return value
    raise TypeError(f"no plain form for {type(value)}: {value!r}")


def outline(described: dict, *, most: int = 64) -> dict:
    """Return the same with a few figures in place of every list of more than `most` numbers.

    The `type` says that all its floats are compared roughly.
    """
    return {key: _outlined(value, most) for key, value in described.items()} | {"type": "rough"}


def _outlined(value: Json, most: int) -> Json:
    if isinstance(value, dict):
        outlined = {key: _outlined(item, most) for key, item in value.items()}
        if isinstance(value.get("values"), list) and isinstance(outlined["values"], dict):
            # A glTF accessor's own count and bounds are as rough as its numbers.
            outlined = {k: v for k, v in outlined.items() if k not in ("count", "min", "max")}
        return outlined
    if not isinstance(value, list):
        return value
    array = np.array(value) if _is_numeric(value) else np.zeros(0)
    if array.size <= most:
        return [_outlined(item, most) for item in value]
    rows = array.reshape(len(array), -1).astype(float)
    figures = {"count": float(len(rows)), "max": rows.max(axis=0)}
    if array.dtype.kind == "f":  # indices may be in another order
        figures |= {"mean": rows.mean(axis=0), "min": rows.min(axis=0)}
    return plain(figures)


def _is_numeric(value: list) -> bool:
    try:
        return np.array(value).dtype.kind in "if"
    except ValueError:
        return False


def fix_signs(quats: np.ndarray) -> np.ndarray:
    """Give each quaternion the sign that makes its largest component positive, shape (..., 4).

    Components are compared to three digits, the first winning, so that noise decides nothing.
    """
    largest = np.argmax(np.round(np.abs(quats), 3), axis=-1)[..., None]
    return np.where(np.take_along_axis(quats, largest, axis=-1) < 0, -quats, quats)


def is_sign_continuous(quats: np.ndarray) -> bool:
    """Say whether each quaternion is on the side of its predecessor along the first axis."""
    return bool((np.sum(quats[1:] * quats[:-1], axis=-1) >= 0).all())


def to_text(value: Json, indent: str = "") -> str:
    """Format as JSON: keys sorted, one item a line, lists of scalars on one line."""
    deeper = indent + " "
    if isinstance(value, dict) and value:
        items = [
            f"{deeper}{json.dumps(key)}: {to_text(value[key], deeper)}" for key in sorted(value)
        ]
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, dict | list) for item in value):
        items = [deeper + to_text(item, deeper) for item in value]
        return "[\n" + ",\n".join(items) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False)
