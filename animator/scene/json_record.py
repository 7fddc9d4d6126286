"""Typed access to an untrusted JSON file, with errors that name the file and the field."""

import dataclasses
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from animator.errors import InputError

_MAX_JSON_BYTES = 256 * 2**20
"""A camera file of ten thousand views takes some 10 MB; the parser needs about ten times that."""


def read_json(path: Path) -> Any:
    """Parse a JSON file.

    Raises:
        InputError: If it cannot be read, is absurdly large, or is no JSON.
    """
    try:
        size_bytes = path.stat().st_size
        content = path.read_bytes() if size_bytes <= _MAX_JSON_BYTES else b""
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}.") from error
    if size_bytes > _MAX_JSON_BYTES:
        raise InputError(
            f"{path}: expected a camera file of at most {_MAX_JSON_BYTES:,} bytes, found "
            f"{size_bytes:,} bytes; is this the right file?"
        )
    try:
        return json.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path}: expected JSON, found something else ({error}); "
            "was the file cut off while it was copied?"
        ) from error


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class JsonRecord:
    """One JSON object and where it stands, for messages."""

    values: dict[str, Any]
    """The fields."""
    where: str
    """File and position, such as `transforms.json: frames[3]`."""

    @classmethod
    def check(cls, value: Any, where: str) -> "JsonRecord":
        """Wrap a value that must be an object."""
        if not isinstance(value, dict):
            raise InputError(f"{where}: expected a JSON object, found {_describe(value)}.")
        return cls(values=value, where=where)

    def __contains__(self, field: str) -> bool:
        return self.values.get(field) is not None

    def number(self, field: str) -> float:
        """Return a finite number.

        Raises:
            InputError: If the field is missing, no number, or not finite.
        """
        value = self._required(field)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{self.where}: {field}: expected a number, found {_describe(value)}.")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise InputError(f"{self.where}: {field}: expected a finite number, found {number}.")
        return number

    def text(self, field: str) -> str:
        """Return a string."""
        value = self._required(field)
        if not isinstance(value, str):
            raise InputError(f"{self.where}: {field}: expected a string, found {_describe(value)}.")
        return value

    def array(self, field: str, *shapes: tuple[int, ...]) -> np.ndarray:
        """Return finite numbers in one of the given shapes, float64."""
        value = self._required(field)
        expected = " or ".join("x".join(str(length) for length in shape) for shape in shapes)
        try:
            array = np.array(value, dtype=np.float64)
        except (ValueError, TypeError, OverflowError) as error:
            raise InputError(
                f"{self.where}: {field}: expected {expected} numbers, found {_describe(value)}."
            ) from error
        if array.shape not in shapes:
            raise InputError(
                f"{self.where}: {field}: expected {expected} numbers, "
                f"found an array of shape {array.shape}."
            )
        if not np.isfinite(array).all():
            raise InputError(f"{self.where}: {field}: expected finite numbers, found NaN or Inf.")
        return array

    def records(self, field: str) -> Iterator["JsonRecord"]:
        """Iterate over a list of objects.

        Raises:
            InputError: If the field is no list, or is empty.
        """
        values = self._required(field)
        if not isinstance(values, list) or not values:
            raise InputError(
                f"{self.where}: {field}: expected a list with at least one entry, "
                f"found {_describe(values)}."
            )
        for index, value in enumerate(values):
            yield JsonRecord.check(value, f"{self.where}: {field}[{index}]")

    def _required(self, field: str) -> Any:
        value = self.values.get(field)
        if value is None:
            known = ", ".join(list(self.values)[:12]) or "nothing"
            raise InputError(
                f"{self.where}: the field {field} is missing; the fields there are: {known}."
            )
        return value


def _describe(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
