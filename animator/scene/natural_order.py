"""Order file names as people do (`frame_2` before `frame_10`) and read their frame numbers."""

import itertools
import logging
import re
from collections.abc import Iterable, Sequence
from pathlib import PurePath

logger = logging.getLogger(__name__)

_DIGITS = re.compile(r"([0-9]+)")
_LONGEST_NUMBER = 18
"""Digits beyond which a run is an identifier, not a frame number (and would not fit an int64)."""


def natural_key(name: str) -> tuple[tuple[tuple[int, str], ...], str]:
    """Return a sort key that compares runs of digits by their value.

    Runs are compared as (length, text) without leading zeros, so that no name, however long its
    digits, is turned into a number. Equal names up to zeros and case are ordered by the raw text.
    """
    parts = _DIGITS.split(name)
    key = tuple(
        (len(part.lstrip("0")), part.lstrip("0")) if index % 2 else (0, part.casefold())
        for index, part in enumerate(parts)
    )
    return key, name


def last_number(name: str) -> int | None:
    """Return the last run of digits in a file name without its suffix, None without one."""
    runs = digit_runs(name)
    return runs[-1] if runs else None


def digit_runs(name: str) -> tuple[int, ...]:
    """Return all runs of digits in a file name without folder and suffix, as numbers."""
    runs = _DIGITS.findall(PurePath(name).stem)
    return tuple(int(run) for run in runs if len(run) <= _LONGEST_NUMBER)


def frame_numbers(names: Sequence[str]) -> tuple[int, ...]:
    """Read the frame numbers of naturally ordered file names.

    The number is the last run of digits that grows strictly from name to name, so that
    `frame0007_1080p.png` is frame 7. Names without one are numbered by position, with a warning.

    Returns:
        Strictly increasing numbers, one for each name.
    """
    rows = [digit_runs(name) for name in names]
    if rows and len({len(row) for row in rows}) == 1:
        for column in reversed(range(len(rows[0]))):
            numbers = tuple(row[column] for row in rows)
            if is_increasing(numbers):
                return numbers
    if len(names) > 1:
        logger.warning(
            "The names of the %d frames hold no number that grows from frame to frame "
            "(first %r, last %r): numbering them 0..%d by position.",
            len(names),
            names[0],
            names[-1],
            len(names) - 1,
        )
    return tuple(range(len(names)))


def is_increasing(numbers: Sequence[int]) -> bool:
    """Return whether each number is larger than the one before."""
    return all(before < after for before, after in itertools.pairwise(numbers))


def missing_ranges(numbers: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Find the gaps in increasing frame numbers.

    The spacing of the clip is its smallest step: 0, 6, 12 has no gap, 0, 6, 18 lacks frame 12.

    Returns:
        First and last missing number of each gap.
    """
    steps = [after - before for before, after in itertools.pairwise(numbers)]
    spacing = min(steps, default=1)
    return tuple(
        (before + spacing, before + spacing * ((step - 1) // spacing))
        for before, step in zip(numbers, steps, strict=False)
        if step > spacing
    )


def describe_ranges(ranges: Iterable[tuple[int, int]], *, shown: int = 8) -> str:
    """Write ranges as `3, 7-9 and 2 more`."""
    texts = [f"{first}" if first == last else f"{first}-{last}" for first, last in ranges]
    text = ", ".join(texts[:shown])
    return text if len(texts) <= shown else f"{text} and {len(texts) - shown} more"
