"""The helpers that run the official validators: they run, and they see what is wrong."""

from pathlib import Path

import pytest

from exporters.gltf.write import write_gltf
from exporters.usd.write import write_usd_rig
from tests.helpers import clips, validators
from tests.helpers.node import NodeMissingError


def test_gltf_validator_sees_a_wrong_bound(tmp_path: Path) -> None:
    path, _ = write_gltf(clips.static(), tmp_path / "clip.gltf")
    text = path.read_text()
    broken = text.replace('"alphaCutoff": 0.2', '"alphaCutoff": -1')
    assert broken != text
    path.write_text(broken)
    found = [issue for issue in validators.gltf_issues(path) if "splatting" not in issue.pointer]
    assert ("error", "VALUE_NOT_IN_RANGE", "/materials/0/alphaCutoff") in {
        (issue.severity, issue.code, issue.pointer) for issue in found
    }


def test_gltf_validator_reads_the_buffer_beside_a_gltf(tmp_path: Path) -> None:
    path, blob = write_gltf(clips.static(), tmp_path / "clip.gltf")
    blob.write_bytes(blob.read_bytes()[:-100])
    assert any(
        issue.code == "BUFFER_BYTE_LENGTH_MISMATCH" for issue in validators.gltf_issues(path)
    )


@pytest.mark.parametrize("name", sorted(clips.ALL))
def test_usd_validators_find_nothing(name: str, tmp_path: Path) -> None:
    write_usd_rig(clips.ALL[name](), tmp_path / "clip.usda")
    assert validators.usd_errors(tmp_path / "clip.usda") == []


def test_usd_validators_see_a_missing_up_axis(tmp_path: Path) -> None:
    path = tmp_path / "clip.usda"
    write_usd_rig(clips.static(), path)
    lines = [line for line in path.read_text().splitlines() if "upAxis" not in line]
    path.write_text("\n".join(lines))
    assert any("upAxis" in finding for finding in validators.usd_errors(path))


def test_a_missing_node_fails_and_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(NodeMissingError, match=r"install Node\.js 20"):
        validators.gltf_issues(tmp_path / "clip.glb")
