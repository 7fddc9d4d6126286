"""Running the scripts of `tests/npm` under node; their packages are installed on first use."""

import contextlib
import shutil
import subprocess
import tempfile
from pathlib import Path

NPM_FOLDER = Path(__file__).parents[1] / "npm"

_LOCK = "package-lock.json"


class NodeMissingError(RuntimeError):
    """Node or a package cannot be had here; the message says what to install."""


def run_script(script: str, *arguments: object, stdin: str | None = None) -> str:
    """Run one script of `tests/npm` and return what it prints.

    Raises:
        NodeMissingError: If node or npm is missing, or the packages cannot be installed.
        RuntimeError: If the script fails, with what it said.
    """
    install_packages()
    command = [_program("node"), NPM_FOLDER / script, *map(str, arguments)]
    result = subprocess.run(command, input=stdin, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise RuntimeError(f"{script} failed on {arguments}:\n{result.stdout}{result.stderr}")
    return result.stdout


def install_packages() -> None:
    """Install the locked packages, unless they are there; test processes may run side by side."""
    target = NPM_FOLDER / "node_modules"
    lock = (NPM_FOLDER / _LOCK).read_bytes()
    installed = target / _LOCK
    if installed.is_file() and installed.read_bytes() == lock:
        return
    command = [_program("npm"), "ci", "--no-audit", "--no-fund"]
    with tempfile.TemporaryDirectory(dir=NPM_FOLDER, prefix="node_modules_") as staging:
        for name in ("package.json", _LOCK):
            shutil.copy(NPM_FOLDER / name, staging)
        result = subprocess.run(command, cwd=staging, capture_output=True, text=True, check=False)
        if result.returncode != 0:
            raise NodeMissingError(
                f"the packages of the tests could not be installed; run `npm ci` once in "
                f"{NPM_FOLDER}, where the npm registry can be reached.\n{result.stderr}"
            )
        (Path(staging) / "node_modules" / _LOCK).write_bytes(lock)
        # Another process may have been faster; then its copy is as good. Packages of an older
        # lock go with the staging folder.
        with contextlib.suppress(OSError):
            target.rename(Path(staging) / "older")
        with contextlib.suppress(OSError):
            (Path(staging) / "node_modules").rename(target)


def _program(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        raise NodeMissingError(
            f"{name} is not on the PATH; the tests of glTF files run Khronos' validator: install "
            "Node.js 20 or newer (https://nodejs.org or your package manager), which brings node "
            "and npm"
        )
    return found
