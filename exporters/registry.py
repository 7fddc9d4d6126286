"""Which writer makes which file, chosen by the end of its name."""

import importlib
from collections.abc import Callable
from pathlib import Path

from exporters.clip import Clip
from exporters.errors import WriteError
from exporters.options import ExportOptions

EXPORTERS: dict[str, str] = {
    ".usd": "exporters.usd.write:write_usd_rig",
    ".usda": "exporters.usd.write:write_usd_rig",
    ".usdc": "exporters.usd.write:write_usd_rig",
    ".usdz": "exporters.usd.write:write_usd_rig",
    ".glb": "exporters.gltf.write:write_gltf",
    ".gltf": "exporters.gltf.write:write_gltf",
    ".splatimate.npz": "exporters.clip_io:save_clip",
    "_gaussians": "exporters.ply.sequence:write_ply_sequence",
    "_gaussians.usd": "exporters.usd.cache:write_usd_cache",
    "_gaussians.usda": "exporters.usd.cache:write_usd_cache",
    "_gaussians.usdc": "exporters.usd.cache:write_usd_cache",
    "_gaussians.usdz": "exporters.usd.cache:write_usd_cache",
}
"""End of a path to `module:function`; the longest that fits counts. Resolved on use, so that no
package is imported for a format that is not written."""

Exporter = Callable[..., tuple[Path, ...]]
"""Writes a clip to a path as the options say; returns the files written."""


def exporter_for(path: str | Path) -> Exporter:
    """Return the writer for a path.

    Raises:
        WriteError: If no writer fits, with those known, or if a package it needs is missing.
    """
    name = Path(path).name.lower()
    ending = max((end for end in EXPORTERS if name.endswith(end)), key=len, default=None)
    if ending is None:
        raise WriteError(
            f"{path}: no format is known by this name; end it in one of "
            f"{', '.join(EXPORTERS)} (`_gaussians` is a folder of PLY files)"
        )
    module_name, function_name = EXPORTERS[ending].split(":")
    try:
        return getattr(importlib.import_module(module_name), function_name)
    except ModuleNotFoundError as error:
        raise WriteError(
            f"{path}: writing {ending} needs the package {error.name!r}; "
            "install splatimate with all its dependencies (pip install splatimate)"
        ) from error


def export_clip(
    clip: Clip, path: str | Path, options: ExportOptions | None = None
) -> tuple[Path, ...]:
    """Write a clip in the format that the path's name asks for.

    Args:
        clip: The clip.
        path: The target, for example `out/clip.glb`; see `EXPORTERS`.
        options: What goes into the file; None for the defaults.

    Returns:
        The files written.

    Raises:
        ClipError: If the clip is not valid.
        WriteError: If the format is unknown or the place cannot be written.
    """
    return exporter_for(path)(clip, Path(path), options or ExportOptions())
