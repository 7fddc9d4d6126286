"""Compiling a numba kernel so that its disk cache can be trusted."""

import hashlib
import logging
import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numba

_log = logging.getLogger(__name__)

STRICT = frozenset({"nsz", "contract"})
"""Fused multiply-add and unsigned zeros: keeps NaN tests and the order of additions intact."""

RELAXED = STRICT | {"arcp", "afn"}
"""Also divisions by reciprocals and approximate functions."""

_ONLY_PRANGE = {
    "prange": True,
    "comprehension": False,
    "reduction": False,
    "inplace_binop": False,
    "setitem": False,
    "numpy": False,
    "stencil": False,
    "fusion": False,
}
"""Loops over `prange` become parallel, and nothing else behind the kernel's back."""

LANES_VARIABLE = "SPLATIMATE_SIMD_LANES"
"""Environment variable that overrides the vector width (8 or 16), for tests and odd machines."""


def kernel(
    *,
    parallel: bool = False,
    fastmath: frozenset[str] = STRICT,
    depends_on: tuple[ModuleType, ...] = (),
) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function with numba, cached on disk.

    numba notices that the file of the kernel changed, but not that a module it inlines did, so a
    digest of those modules becomes part of the kernel's qualified name, hence of its cache file.

    Args:
        parallel: Whether `prange` loops run on several threads.
        fastmath: LLVM fast-math flags, `STRICT` or `RELAXED`.
        depends_on: Modules whose functions or constants are compiled into this kernel.

    Returns:
        A decorator that turns a Python function into a compiled one.
    """
    digest = _digest(depends_on)

    def compile_later(function: Callable[..., Any]) -> Any:
        function.__qualname__ = f"{function.__qualname__}_{digest}"
        options: dict[str, Any] = {
            "parallel": dict(_ONLY_PRANGE) if parallel else False,
            "fastmath": set(fastmath),
            "error_model": "numpy",
            "boundscheck": False,
        }
        try:
            return numba.njit(cache=True, **options)(function)
        except RuntimeError as error:  # neither the package nor the user's cache folder is writable
            _log.info("%s is compiled anew in every process: %s", function.__name__, error)
            return numba.njit(**options)(function)

    return compile_later


def _digest(modules: tuple[ModuleType, ...]) -> str:
    digest = hashlib.sha256(os.environ.get(LANES_VARIABLE, "").encode())
    for module in modules:
        assert module.__file__ is not None, f"{module.__name__} has no source file"
        digest.update(Path(module.__file__).read_bytes())
    return digest.hexdigest()[:12]
