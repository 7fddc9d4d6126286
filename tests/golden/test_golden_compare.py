"""The comparison itself notices what it should, and nothing else."""

import copy
import json

import numpy as np
import pytest

from tests.golden import regenerate
from tests.golden.cases import golden_path
from tests.golden.compare import differences, report
from tests.golden.semantics import fix_signs, is_sign_continuous, plain, to_text

DOCUMENT = {
    "nodes": {"door": {"rotation": [0.0, 0.5, 1.0], "children": ["knob"], "count": 3}},
    "is_closed": True,
    "scales": {"type": "half3[]", "default": [[1.0, 1.0, 1.0]]},
}


def changed(*path: object, value: object) -> dict:
    """Copy the document with one value replaced."""
    document = copy.deepcopy(DOCUMENT)
    place = document
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    return document


def test_a_document_equals_itself() -> None:
    assert differences(DOCUMENT, copy.deepcopy(DOCUMENT)) == []


@pytest.mark.parametrize(
    ("found", "line"),
    [
        (
            changed("nodes", "door", "rotation", 1, value=0.501),
            "/nodes/door/rotation[1]: expected 0.5, got 0.501",
        ),
        (
            changed("nodes", "door", "rotation", value=[0.0, 0.5]),
            "/nodes/door/rotation: expected 3 items, got 2",
        ),
        (
            changed("nodes", "door", "count", value=3.0),
            "/nodes/door/count: expected int 3, got float 3.0",
        ),
        (changed("is_closed", value=1), "/is_closed: expected bool True, got int 1"),
        (changed("nodes", "door", value={}), "/nodes/door/children: missing, expected ['knob']"),
        (changed("hinges", value=2), "/hinges: unexpected, got 2"),
        (
            changed("nodes", "door", "children", 0, value="lock"),
            "/nodes/door/children[0]: expected 'knob', got 'lock'",
        ),
        (
            changed("nodes", "door", "rotation", 2, value=float("nan")),
            "/nodes/door/rotation[2]: expected 1.0, got nan",
        ),
        (
            changed("scales", "default", 0, 1, value=1.01),
            "/scales/default[0][1]: expected 1.0, got 1.01",
        ),
    ],
)
def test_a_difference_is_found_and_named(found: dict, line: str) -> None:
    assert line in differences(DOCUMENT, found)


def test_rounding_is_no_difference() -> None:
    assert differences(DOCUMENT, changed("nodes", "door", "rotation", 2, value=1.00001)) == []
    assert differences(DOCUMENT, changed("nodes", "door", "rotation", 0, value=-1e-6)) == []
    assert differences(DOCUMENT, changed("nodes", "door", "rotation", 2, value=1.0001)) != []


def test_half_precision_is_allowed_only_where_the_type_says_so() -> None:
    assert differences(DOCUMENT, changed("scales", "default", 0, 1, value=1.00098)) == []
    assert differences(DOCUMENT, changed("nodes", "door", "rotation", 2, value=1.00098)) != []


def test_a_report_is_cut_and_says_so() -> None:
    lines = report([0.0] * 30, [1.0] * 30, limit=3).splitlines()
    assert len(lines) == 4
    assert lines[-1] == "... and 27 more"


def test_text_reads_back_as_the_same_data() -> None:
    assert json.loads(to_text(DOCUMENT)) == DOCUMENT
    assert json.loads(to_text({"empty": [], "nothing": {}, "name": 'Tür [1] "a"'})) == {
        "empty": [],
        "nothing": {},
        "name": 'Tür [1] "a"',
    }


def test_numbers_keep_six_digits_and_no_noise() -> None:
    assert plain(np.array([1 / 3, -1e-17, 2e9 / 3])) == [0.333333, 0.0, 666667000.0]


def test_quaternion_signs_do_not_depend_on_noise() -> None:
    half = np.sqrt(0.5)
    quats = np.array([[-half, 0.0, 0.0, half + 1e-7], [half + 1e-7, 0.0, 0.0, -half]])
    np.testing.assert_allclose(fix_signs(quats), np.tile([half, 0, 0, -half], (2, 1)), atol=1e-6)


def test_sign_jumps_are_seen() -> None:
    quats = np.array([[1.0, 0.0, 0.0, 0.0], [-0.9, 0.1, 0.0, 0.0]])
    assert not is_sign_continuous(quats)
    assert is_sign_continuous(np.abs(quats))


def test_regenerate_tells_the_change_and_writes_it(
    tmp_path: object, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    document = json.loads(golden_path("hinge", "gltf").read_text(encoding="utf-8"))
    document["default_scene"] = "window"
    target = tmp_path / "hinge.gltf.json"
    target.write_text(to_text(document), encoding="utf-8")
    monkeypatch.setattr(regenerate, "golden_path", lambda name, form: target)
    assert regenerate.main(["hinge.gltf"]) == 0
    assert "/default_scene: expected 'window', got 'hinge'" in capsys.readouterr().out
    assert target.read_bytes() == golden_path("hinge", "gltf").read_bytes()
    assert regenerate.main(["hinge.gltf"]) == 0
    assert "hinge.gltf: no difference(s)" in capsys.readouterr().out


def test_regenerate_refuses_an_unknown_case(capsys: pytest.CaptureFixture[str]) -> None:
    assert regenerate.main(["hinges"]) == 2
    assert "unknown: hinges; known: chain," in capsys.readouterr().err
