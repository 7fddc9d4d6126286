"""What is wrong with a file: where, what was expected there and what was found."""

import dataclasses
import functools
from collections.abc import Iterator

import numpy as np


@dataclasses.dataclass(frozen=True, kw_only=True)
class Problem:
    """One broken promise of a file."""

    place: str
    """Where: a prim and attribute, a JSON pointer, a line or a row."""
    expected: str
    """What should be there."""
    found: str
    """What is there."""

    def __str__(self) -> str:
        return f"{self.place}: expected {self.expected}, found {self.found}"


def count_bad(place: str, is_bad: np.ndarray, *, expected: str, what: str) -> Iterator[Problem]:
    """Yield one problem if any entry is bad, with their count and the first index.

    Args:
        place: Where the entries are.
        is_bad: Which are bad, bool, any shape.
        expected: What all should be.
        what: What the bad ones are, in the plural.
    """
    if is_bad.any():
        count = int(np.count_nonzero(is_bad))
        first = [int(i) for i in np.unravel_index(int(np.argmax(is_bad)), is_bad.shape)]
        where = first[0] if len(first) == 1 else tuple(first)
        yield Problem(place=place, expected=expected, found=f"{count} {what} (first at {where})")


def any_in_row(is_bad: np.ndarray) -> np.ndarray:
    """Return which rows hold a True, shape (V, K) to (V,); numpy's `any` is slow on short rows."""
    return functools.reduce(np.logical_or, is_bad.T, np.zeros(len(is_bad), bool))
