"""Options from a TOML file."""

import difflib
import tomllib
from pathlib import Path
from typing import Any

from animator.commands.value_kind import ValueKindError
from animator.config import OptionInfo, option_infos
from animator.errors import InputError

AUTO = Path("auto")
"""Value of `--frame-camera` that is a word, not a path."""


def read_config_file(path: Path) -> dict[str, Any]:
    """Read the options that a TOML file sets.

    Keys are the long flags without dashes in front, with `-` or `_` inside (`frame-camera`); lists
    stand for repeated flags; the switches of the method are `deform = false` and the like. Relative
    paths count from the file's folder, so that a scene and its settings move together.

    Args:
        path: The file.

    Returns:
        Checked values by field name of `AnimateOptions`, only those the file sets.

    Raises:
        InputError: If it cannot be read, is no TOML, or has an unknown key or a wrong value.
    """
    infos = option_infos()
    options: dict[str, Any] = {}
    for key, value in _read_toml(path).items():
        name = key.replace("-", "_")
        if name not in infos:
            raise InputError(_unknown_key(path, key, infos))
        if name in options:
            raise InputError(f"{path}: {key}: set twice, with - and with _; keep one of them.")
        options[name] = _beside(path, _accept(path, key, value, infos[name]))
    return options


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: --config cannot be read: {error.strerror or error}.") from error
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path}: expected TOML, such as `every = 2`, found something else ({error})."
        ) from error


def _accept(path: Path, key: str, value: Any, info: OptionInfo) -> Any:
    try:
        if not info.is_repeatable:
            return info.kind.accept(value)
        values = value if isinstance(value, list) else [value]
        return tuple(info.kind.accept(item) for item in values)
    except ValueKindError as error:
        raise InputError(f"{path}: {key}: {error}.") from error


def _beside(path: Path, value: Any) -> Any:
    """Count relative paths from the folder of the TOML file."""
    if isinstance(value, Path):
        return value if value == AUTO else path.parent / value.expanduser()
    if isinstance(value, tuple):
        return tuple(_beside(path, item) for item in value)
    return value


def _unknown_key(path: Path, key: str, infos: dict[str, OptionInfo]) -> str:
    known = [name.replace("_", "-") for name in infos]
    nearest = difflib.get_close_matches(key.replace("_", "-"), known, n=1)
    advice = f"did you mean {nearest[0]}?" if nearest else f"known keys: {', '.join(known)}."
    return f"{path}: {key}: expected the name of an option, found an unknown key; {advice}"
