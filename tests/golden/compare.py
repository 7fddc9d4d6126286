"""Structure exactly, numbers nearly: the comparison behind the golden files."""

import dataclasses
import math

from tests.golden.semantics import Json

_MISSING = object()


@dataclasses.dataclass(frozen=True, kw_only=True)
class Tolerance:
    """How far a float may be off: `absolute + relative * |expected|`."""

    relative: float
    absolute: float


FLOAT = Tolerance(relative=1e-5, absolute=1e-6)
HALF = Tolerance(relative=1e-3, absolute=1e-3)
"""For values stored in 16 bits, which keep three digits."""

ROUGH = Tolerance(relative=0.05, absolute=0.05)
"""For figures of a surface, which another processor may triangulate a little differently."""

_TOLERANCES = {
    **dict.fromkeys(("half", "quath", "point3h", "normal3h", "color3h"), HALF),
    "rough": ROUGH,
}
"""By the beginning of a mapping's `type`."""


def differences(expected: Json, found: Json) -> list[str]:
    """Return every difference, each with its path, e.g. `/nodes/door/rotation[2]: expected ...`.

    A mapping with a `type` of USD's 16-bit types is compared with that precision, one of type
    `rough` roughly.
    """
    return _compare("", expected, found, FLOAT)


def report(expected: Json, found: Json, *, limit: int = 20) -> str:
    """Return the differences as text, at most `limit` of them and a count of the others."""
    lines = differences(expected, found)
    hidden = len(lines) - limit
    return "\n".join(lines[:limit] + ([f"... and {hidden} more"] if hidden > 0 else []))


def _compare(path: str, expected: object, found: object, tolerance: Tolerance) -> list[str]:
    if expected is _MISSING:
        return [f"{path}: unexpected, got {_short(found)}"]
    if found is _MISSING:
        return [f"{path}: missing, expected {_short(expected)}"]
    if type(expected) is not type(found):
        return [
            f"{path}: expected {type(expected).__name__} {_short(expected)}, "
            f"got {type(found).__name__} {_short(found)}"
        ]
    if isinstance(expected, dict):
        for start, own in _TOLERANCES.items():
            if str(expected.get("type", "")).startswith(start):
                tolerance = own
        return [
            line
            for key in sorted(expected.keys() | found.keys())
            for line in _compare(
                f"{path}/{key}", expected.get(key, _MISSING), found.get(key, _MISSING), tolerance
            )
        ]
    if isinstance(expected, list):
        if len(expected) != len(found):
            return [f"{path}: expected {len(expected)} items, got {len(found)}"]
        return [
            line
            for index, (left, right) in enumerate(zip(expected, found, strict=True))
            for line in _compare(f"{path}[{index}]", left, right, tolerance)
        ]
    if isinstance(expected, float):
        same = math.isclose(
            expected,
            found,
            rel_tol=0.0,
            abs_tol=tolerance.absolute + tolerance.relative * abs(expected),
        )
        return [] if same else [f"{path}: expected {expected}, got {found}"]
    return [] if expected == found else [f"{path}: expected {expected!r}, got {found!r}"]


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
