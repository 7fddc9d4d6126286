"""Which rules a file is held to, chosen by the end of its name."""

import importlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from exporters.check.problem import Problem
from exporters.clip_io import SUFFIX
from exporters.errors import ClipError

_USD = "exporters.check.usd.guarded:check_usd_guarded"
_TRUSTED_USD = "exporters.check.usd.file:check_usd"
_GLTF = "exporters.check.gltf.file:check_gltf"
_SEQUENCE = "exporters.check.ply:check_sequence"
CHECKERS: dict[str, str] = {
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), _USD),
    **dict.fromkeys((".glb", ".gltf"), _GLTF),
    ".ply": "exporters.check.ply:check_ply",
    SUFFIX: "exporters.check.clip:check_clip",
}
"""End of a name to `module:function`, resolved on use: no package is imported for other formats."""


def check_file(path: str | Path, *, is_trusted: bool = False) -> tuple[Problem, ...]:
    """Check a file, or a folder of PLY files.

    Args:
        path: USD (.usd .usda .usdc .usdz), glTF (.glb .gltf), .ply, .splatimate.npz, or a folder
            that holds one .ply a frame.
        is_trusted: Whether this program wrote it: then a USD file is read in this process, which
            saves half a second; a damaged one could end it.

    Returns:
        All problems found, none for a good file.

    Raises:
        ClipError: If there is no such file, it may not be read, or it is of no known kind.
    """
    path = Path(path)
    if not path.exists():
        raise ClipError(f"{path}: no such file; expected one to check")
    checker = _checker_name(path)
    if checker is None:
        raise ClipError(
            f"{path}: no kind of file is known by this name; expected one that ends in "
            f"{', '.join(CHECKERS)}, or a folder of .ply files"
        )
    if is_trusted and checker == _USD:
        checker = _TRUSTED_USD
    module_name, function_name = checker.split(":")
    check: Callable[[Path], Iterator[Problem]]
    check = getattr(importlib.import_module(module_name), function_name)
    try:
        with np.errstate(all="ignore"):  # odd numbers are what is looked for
            return tuple(check(path))
    except OSError as error:
        raise ClipError(f"{path}: cannot be read ({error.strerror or error})") from error


def is_known(path: str | Path) -> bool:
    """Say whether there are rules for a file of this name."""
    return _checker_name(Path(path)) is not None


def _checker_name(path: Path) -> str | None:
    if path.is_dir():
        is_sequence = any(inner.suffix.lower() == ".ply" for inner in path.iterdir())
        return _SEQUENCE if is_sequence else None
    name = path.name.lower()
    ending = max((end for end in CHECKERS if name.endswith(end)), key=len, default=None)
    return CHECKERS[ending] if ending else None
