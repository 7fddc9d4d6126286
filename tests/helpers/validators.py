"""The official validators: Khronos gltf-validator (through node) and UsdValidation.

They are part of the test suite: where one is missing the tests fail, they are not skipped.
"""

import dataclasses
import json
from pathlib import Path

from tests.helpers.node import run_script

_SEVERITIES = ("error", "warning", "info", "hint")


@dataclasses.dataclass(frozen=True, order=True)
class Issue:
    """One finding of the glTF validator."""

    severity: str
    code: str
    pointer: str
    message: str = dataclasses.field(compare=False)


def gltf_issues(path: Path) -> list[Issue]:
    """Return everything the Khronos validator says about one .glb or .gltf file, sorted."""
    (report,) = json.loads(run_script("validate_gltf.cjs", path))
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
