"""Where everything goes: planned and checked before any work."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

from exporters.clip_io import SUFFIX as CLIP_SUFFIX
from exporters.companions import companions
from exporters.errors import WriteError
from exporters.options import ExportOptions
from exporters.registry import EXPORTERS

ASSET_SUFFIXES = tuple(end for end in EXPORTERS if end[0] == "." and end != CLIP_SUFFIX)
"""What an `--out` may end in."""
_CACHE_ENDING = "_gaussians"
_SHOWN = 6


class OutputNameError(ValueError):
    """An `--out` does not name a file we can write; a usage error."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class OutputPlan:
    """The files of one run, all of them beside the first asset but the further assets."""

    assets: tuple[Path, ...]
    """The rigged assets, format by suffix."""
    ply_folder: Path | None = None
    """Folder of one PLY a frame."""
    usd_cache: Path | None = None
    """Time-sampled Gaussians."""
    clip: Path | None = None
    """The clip itself, for `splatimate export`."""
    report_json: Path | None = None
    report_html: Path | None = None
    contact_sheet: Path | None = None
    companions: tuple[Path, ...] = ()
    """What the writers of assets put beside them: a binary, splats, a texture."""
    progress: Path | None = None
    """What an interrupted run leaves; no output."""

    @property
    def stem(self) -> str:
        """Name that all files but further assets begin with."""
        return self.assets[0].stem

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file and folder that is written and stays, assets first."""
        sidecars = (
            self.ply_folder,
            self.usd_cache,
            self.clip,
            self.report_json,
            self.report_html,
            self.contact_sheet,
        )
        return (*self.assets, *self.companions, *(path for path in sidecars if path is not None))

    def make_folders(self) -> None:
        """Make the folders that the files go to."""
        for path in self.files:
            path.parent.mkdir(parents=True, exist_ok=True)

    def check(self, *, overwrite: bool) -> None:
        """Find out before any work whether everything can be written.

        Args:
            overwrite: Whether outputs that exist may be replaced.

        Raises:
            WriteError: If a folder is read-only, or an output exists and must stay.
        """
        for folder in dict.fromkeys(path.parent for path in self.files):
            _check_folder(folder)
        existing = [path for path in self.files if os.path.lexists(path)]
        if existing and not overwrite:
            more = f" and {len(existing) - _SHOWN} more" if len(existing) > _SHOWN else ""
            listed = ", ".join(map(str, existing[:_SHOWN]))
            raise WriteError(
                f"{listed}{more}: already there; give --overwrite to replace, or another --out"
            )
        for path in existing:
            _check_replaceable(path, is_folder=path == self.ply_folder)


def plan_animation(outs: Sequence[Path], cache: str, choices: ExportOptions) -> OutputPlan:
    """Plan the files of `animate`; the sidecars lie beside the first asset, under its name.

    Args:
        outs: The assets to write, at least one.
        cache: `ply`, `usd`, `both` or `none`.
        choices: What goes into the assets.

    Raises:
        OutputNameError: If a name has no known suffix, or two outputs have one name.
    """
    first = outs[0]
    stem = first.with_suffix("")
    plan = dataclasses.replace(
        plan_export(outs, cache, choices),
        clip=_sibling(stem, CLIP_SUFFIX),
        report_json=_sibling(stem, "_report.json"),
        report_html=_sibling(stem, "_report.html"),
        contact_sheet=_sibling(stem, "_report.png"),
        progress=_sibling(stem, ".progress.npz"),
    )
    _check_distinct(plan)
    return plan


def plan_export(outs: Sequence[Path], cache: str, choices: ExportOptions) -> OutputPlan:
    """Plan the files of `export`: assets and caches only. Arguments and errors as above."""
    for path in outs:
        _check_suffix(path)
    stem = outs[0].with_suffix("")
    plan = OutputPlan(
        assets=tuple(outs),
        ply_folder=_sibling(stem, _CACHE_ENDING) if cache in ("ply", "both") else None,
        usd_cache=_sibling(stem, f"{_CACHE_ENDING}.usdc") if cache in ("usd", "both") else None,
        companions=tuple(other for path in outs for other in companions(path, choices)),
    )
    _check_distinct(plan)
    return plan


def _sibling(stem: Path, ending: str) -> Path:
    return stem.with_name(stem.name + ending)


def _check_suffix(path: Path) -> None:
    if path.suffix.lower() not in ASSET_SUFFIXES:
        raise OutputNameError(
            f"--out {path}: expected a name ending in {', '.join(ASSET_SUFFIXES)}; "
            f"found {path.suffix or 'no suffix'}"
        )
    if path.stem.endswith(_CACHE_ENDING):
        raise OutputNameError(
            f"--out {path}: names ending in {_CACHE_ENDING} are those of the caches; choose another"
        )


def _check_distinct(plan: OutputPlan) -> None:
    seen: set[str] = set()
    for path in plan.files:
        # Windows and macOS take names that differ in case only for the same.
        key = os.path.normcase(path.absolute()).casefold()
        if key in seen:
            raise OutputNameError(f"--out: {path} would be written twice; give different names")
        seen.add(key)


def _check_folder(folder: Path) -> None:
    """Check that a folder can be written to, or made."""
    place = folder.absolute()
    while not os.path.lexists(place):
        place = place.parent
    if not place.is_dir():
        raise WriteError(f"{folder}: expected a folder to write to, but {place} is a file")
    if not os.access(place, os.W_OK | os.X_OK):
        raise WriteError(f"{place}: you may not write to this folder; choose another --out")


def _check_replaceable(path: Path, *, is_folder: bool) -> None:
    if path.is_dir() != is_folder:
        found, expected = ("a folder", "a file") if path.is_dir() else ("a file", "a folder")
        raise WriteError(f"{path}: expected {expected} to replace, found {found}; move it away")
    if is_folder:
        strangers = [p.name for p in path.iterdir() if not p.match("clip_[0-9]*.ply")]
        if strangers:
            raise WriteError(
                f"{path}: --overwrite replaces this folder of PLY files, but it also holds "
                f"{', '.join(strangers[:_SHOWN])}; move that away first"
            )
