"""The official validators: Khronos gltf-validator (through node) and UsdValidation.

They are part of the test suite: where one is missing the tests fail, they are not skipped.
"""

import contextlib
import dataclasses
import json
import shutil
import subprocess
import tempfile
from pathlib import Path

NPM_FOLDER = Path(__file__).parents[1] / "npm"

_SEVERITIES = ("error", "warning", "info", "hint")


@dataclasses.dataclass(frozen=True, order=True)
class Issue:
    """One finding of the glTF validator."""

    severity: str
    code: str
    pointer: str
    message: str = dataclasses.field(compare=False)


class ValidatorMissingError(RuntimeError):
    """A validator cannot run here; the message says what to install."""


def gltf_issues(path: Path) -> list[Issue]:
    """Return everything the Khronos validator says about one .glb or .gltf file, sorted."""
    node = _program("node")
    _install_validator()
    script = NPM_FOLDER / "validate_gltf.cjs"
    result = subprocess.run([node, script, path], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise ValidatorMissingError(f"gltf-validator did not run on {path}:\n{result.stderr}")
    (report,) = json.loads(result.stdout)
    assert not report["issues"]["truncated"], "raise maxIssues in validate_gltf.cjs"
    return sorted(
        Issue(
            severity=_SEVERITIES[message["severity"]],
            code=message["code"],
            pointer=message.get("pointer", ""),
            message=message["message"],
        )
        for message in report["issues"]["messages"]
    )


def usd_errors(path: Path) -> list[str]:
    """Return every finding of all validators that ship with USD about one stage."""
    from pxr import Usd, UsdValidation

    stage = Usd.Stage.Open(str(path))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    findings = UsdValidation.ValidationContext(validators).Validate(stage)
    return [f"{finding.GetName()}: {finding.GetMessage()}" for finding in findings]


def _install_validator() -> None:
    """Install the pinned validator on first use; test processes may run side by side."""
    target = NPM_FOLDER / "node_modules"
    if target.is_dir():
        return
    command = [_program("npm"), "ci", "--no-audit", "--no-fund"]
    with tempfile.TemporaryDirectory(dir=NPM_FOLDER, prefix="node_modules_") as staging:
        for name in ("package.json", "package-lock.json"):
            shutil.copy(NPM_FOLDER / name, staging)
        result = subprocess.run(command, cwd=staging, capture_output=True, text=True, check=False)
        if result.returncode != 0:
            raise ValidatorMissingError(
                f"the glTF validator could not be installed; run `npm ci` once in {NPM_FOLDER}, "
                f"where the npm registry can be reached.\n{result.stderr}"
            )
        # Another process may have been faster; then its copy is as good.
        with contextlib.suppress(OSError):
            (Path(staging) / "node_modules").rename(target)


def _program(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        raise ValidatorMissingError(
            f"{name} is not on the PATH; the glTF tests run Khronos' validator: install Node.js 18 "
            "or newer (https://nodejs.org or your package manager), which brings node and npm"
        )
    return found
