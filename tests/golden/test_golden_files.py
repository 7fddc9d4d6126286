"""Every export means what its golden file says."""

import json
from pathlib import Path

import pytest

from tests.golden.cases import CLIPS, DATA_FOLDER, FORMATS, GOLDENS, golden_path
from tests.golden.compare import report


@pytest.mark.parametrize(("name", "form"), GOLDENS)
def test_export_means_what_it_meant(name: str, form: str, tmp_path: Path) -> None:
    found = FORMATS[form](CLIPS[name](), tmp_path)
    expected = json.loads(golden_path(name, form).read_text(encoding="utf-8"))
    lines = report(expected, found)
    assert not lines, (
        f"\n{lines}\nIf that is intended: python -m tests.golden.regenerate {name}.{form}, "
        "and say why in the commit."
    )


def test_no_golden_file_is_left_over() -> None:
    expected = {golden_path(name, form).name for name, form in GOLDENS}
    assert {path.name for path in DATA_FOLDER.iterdir()} == expected
