"""Blender as a Python module, in a virtual environment of its own: `python -m tests.tools.blender_env`.

It wants another numpy than we do, and Python 3.11. It is made once (1 GB) in the user's cache folder,
or wherever SPLATIMATE_BLENDER_ENV says, and used by the tests marked `tools`.
"""

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

BPY = "bpy==5.0.1"
NUMPY = "numpy==1.26.4"
PYTHON = "python3.11"


class BlenderMissingError(RuntimeError):
    """Blender cannot be had here; the message says what to install."""


def blender_python() -> Path:
    """Return the Python that can import bpy; make its environment on first use.

    Raises:
        BlenderMissingError: If Python 3.11 or the package cannot be had.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    default = cache / "splatimate" / BPY.replace("==", "-")
    folder = Path(os.environ.get("SPLATIMATE_BLENDER_ENV", default))
    python = folder / "bin" / "python"
    if not python.exists():
        _make(folder)
    return python


def _make(folder: Path) -> None:
    found = shutil.which(PYTHON)
    if found is None:
        raise BlenderMissingError(
            f"{PYTHON} is not on the PATH; {BPY} is made for it alone: install Python 3.11 "
            "(package manager, pyenv or `uv python install 3.11`)"
        )
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as staging:
        target = Path(staging) / folder.name
        _run(found, "-m", "venv", target)
        _run(target / "bin" / "python", "-m", "pip", "install", "--quiet", BPY, NUMPY)
        # Another process may have been faster; then its copy is as good.
        with contextlib.suppress(OSError):
            target.rename(folder)


def _run(*command: object) -> None:
    result = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise BlenderMissingError(
            f"{' '.join(map(str, command))} failed; installing {BPY} needs PyPI, 1 GB of disk, and "
            f"on Linux the libraries of libxkbcommon, libsm6, libxxf86vm, libxi, libgl1:\n"
            f"{result.stderr[-2000:]}"
        )


if __name__ == "__main__":
    sys.stdout.write(f"{blender_python()}\n")
