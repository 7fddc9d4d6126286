"""No rule speaks up on a good file."""

from pathlib import Path

import pytest

from exporters import export_clip
from exporters.check import check_file
from exporters.check.check_file import CHECKERS
from tests.check.good_files import ENDINGS, LAYOUTS
from tests.helpers import clips


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("name", clips.ALL)
def test_every_clip_in_every_format_passes(name: str, ending: str, tmp_path: Path) -> None:
    export_clip(clips.ALL[name](), tmp_path / f"clip{ending}")
    assert check_file(tmp_path / f"clip{ending}", is_trusted=True) == ()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_passes(layout: str, tmp_path: Path) -> None:
    ending, options = LAYOUTS[layout]
    written = export_clip(clips.random(), tmp_path / f"clip{ending}", options)
    for path in (tmp_path / f"clip{ending}", *written):
        if path.suffix in CHECKERS:
            assert check_file(path, is_trusted=True) == (), path
