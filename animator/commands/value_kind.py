"""The kinds of value an option takes: one check for flags and for TOML files."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any


class ValueKindError(ValueError):
    """A value is not of the wanted kind; the message says what was expected and what was found."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ValueKind:
    """What an option takes."""

    expected: str
    """What is wanted, to be read after `expected`."""
    metavar: str | None
    """Placeholder in the help text, None for a switch."""
    from_text: Callable[[str], Any]
    """Turns the text of a flag into the value a TOML file would hold; may raise ValueError."""
    check: Callable[[Any], Any]
    """Turns the value of a TOML file into the option's value; raises ValueError or TypeError."""

    def parse(self, text: str) -> Any:
        """Read a flag's text.

        Raises:
            ValueKindError: If it is of another kind.
        """
        try:
            return self.check(self.from_text(text))
        except (ValueError, TypeError) as error:
            raise ValueKindError(f"expected {self.expected}, found {text!r}") from error

    def accept(self, value: Any) -> Any:
        """Read a value that a TOML file holds.

        Raises:
            ValueKindError: If it is of another kind.
        """
        try:
            return self.check(value)
        except (ValueError, TypeError) as error:
            raise ValueKindError(f"expected {self.expected}, found {value!r}") from error


def whole(minimum: int, metavar: str = "N") -> ValueKind:
    """Take whole numbers from a minimum up."""
    return ValueKind(
        expected=f"a whole number, {minimum} or more",
        metavar=metavar,
        from_text=int,
        check=lambda value: _at_least(minimum, _whole(value)),
    )


def positive(metavar: str) -> ValueKind:
    """Take finite numbers above zero."""
    return ValueKind(expected="a number above 0", metavar=metavar, from_text=float, check=_positive)


def not_negative(metavar: str) -> ValueKind:
    """Take finite numbers from zero up."""
    return ValueKind(
        expected="a number, 0 or more", metavar=metavar, from_text=float, check=_not_negative
    )


def share() -> ValueKind:
    """Take numbers from 0 to 1."""
    return ValueKind(expected="a number from 0 to 1", metavar="X", from_text=float, check=_share)


def choice(*names: str) -> ValueKind:
    """Take one of some names."""

    def check(value: Any) -> str:
        if value not in names:
            raise ValueError
        return value

    listed = f"{', '.join(names[:-1])} or {names[-1]}"
    return ValueKind(
        expected=listed, metavar="{" + ",".join(names) + "}", from_text=str, check=check
    )


def text(metavar: str = "TEXT") -> ValueKind:
    """Take any text with something in it."""
    return ValueKind(expected="a text", metavar=metavar, from_text=str, check=_text)


def path(metavar: str = "PATH") -> ValueKind:
    """Take the path of a file or folder."""
    return ValueKind(
        expected="a path", metavar=metavar, from_text=str, check=lambda value: Path(_text(value))
    )


def switch() -> ValueKind:
    """Take yes or no: a flag without a value."""
    return ValueKind(expected="true or false", metavar=None, from_text=str, check=_boolean)


def listed(item: ValueKind, separator: str) -> ValueKind:
    """Take several values: a list in TOML, separated text in a flag."""

    def check(values: Any) -> tuple[Any, ...]:
        if isinstance(values, str) or not values:
            raise ValueError
        return tuple(item.check(value) for value in values)

    return ValueKind(
        expected=f"a list of values, each {item.expected}",
        metavar=f"{item.metavar}[{separator}{item.metavar}...]",
        from_text=lambda text: [item.from_text(part) for part in text.split(separator)],
        check=check,
    )


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError
    return value


def _at_least(minimum: int, value: int) -> int:
    if value < minimum:
        raise ValueError
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TypeError
    return float(value)


def _positive(value: Any) -> float:
    number = _number(value)
    if number <= 0:
        raise ValueError
    return number


def _not_negative(value: Any) -> float:
    number = _number(value)
    if number < 0:
        raise ValueError
    return number


def _share(value: Any) -> float:
    number = _number(value)
    if not 0 <= number <= 1:
        raise ValueError
    return number


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value or "\0" in value:
        raise TypeError
    return value


def _boolean(value: Any) -> bool:
    if not isinstance(value, bool):
        raise TypeError
    return value
