from pathlib import Path

import pytest

from exporters.atomic import replacing, replacing_folder
from exporters.errors import WriteError


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_file_appears_whole_with_its_name_kept(tmp_path):
    target = tmp_path / "new" / "clip.usda"
    with replacing(target) as staged:
        assert staged.name == "clip.usda"
        staged.write_text("all")
        assert not target.exists()
    assert target.read_text() == "all"
    assert names_in(target.parent) == ["clip.usda"]


def test_permissions_are_those_of_an_ordinary_file(tmp_path):
    with replacing(tmp_path / "a.txt") as staged:
        staged.write_text("a")
    (tmp_path / "b.txt").write_text("b")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_failure_keeps_the_old_file_and_leaves_nothing(tmp_path, error):
    target = tmp_path / "clip.usda"
    target.write_text("old")
    with pytest.raises(error), replacing(target) as staged:
        staged.write_text("half")
        raise error
    assert target.read_text() == "old"
    assert names_in(tmp_path) == ["clip.usda"]


def test_disk_errors_name_the_target(tmp_path):
    expected = r"clip\.usda: cannot be written \(No space left"
    with pytest.raises(WriteError, match=expected), replacing(tmp_path / "clip.usda"):
        raise OSError(28, "No space left on device")
    assert not list(tmp_path.iterdir())


def test_unusable_places_are_explained(tmp_path):
    (tmp_path / "file").write_text("")
    for place, message in (
        (replacing(tmp_path / "file" / "clip.usda"), r"check that .*file is a folder"),
        (replacing(tmp_path), "found a folder"),
        (replacing_folder(tmp_path / "file"), "found a file"),
    ):
        with pytest.raises(WriteError, match=message), place:
            raise AssertionError("must not be entered")


def test_writing_nothing_is_an_error(tmp_path):
    with pytest.raises(WriteError, match="nothing was written"), replacing(tmp_path / "clip.usda"):
        pass


def test_folder_replaces_folder(tmp_path):
    target = tmp_path / "frames"
    for contents in ("old", "new"):
        with replacing_folder(target) as staged:
            (staged / f"{contents}.ply").write_text(contents)
    assert names_in(tmp_path) == ["frames"]
    assert names_in(target) == ["new.ply"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_failure_keeps_the_old_folder(tmp_path, error):
    target = tmp_path / "frames"
    target.mkdir()
    (target / "old.ply").write_text("old")
    with pytest.raises(error), replacing_folder(target) as staged:
        (staged / "half.ply").write_text("half")
        raise error
    assert names_in(tmp_path) == ["frames"]
    assert names_in(target) == ["old.ply"]


def test_a_failed_last_step_puts_the_old_folder_back(tmp_path, monkeypatch):
    target = tmp_path / "frames"
    target.mkdir()
    (target / "old.ply").write_text("old")
    rename = Path.rename

    def failing(path, destination):
        if path.parent.name.startswith(".frames") and path.name == "frames":
            raise OSError(5, "Input/output error")
        return rename(path, destination)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(WriteError, match="Input/output error"), replacing_folder(target):
        pass
    assert names_in(tmp_path) == ["frames"]
    assert names_in(target) == ["old.ply"]
