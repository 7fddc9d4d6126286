"""What each tool makes of each file, as a Markdown table.

    python -m tests.tools.matrix out/clip.splatimate.npz

Errors are the largest distance of any vertex, at the clip's keys and half-way between them, from where
the clip has it, in diagonals of the object; what is lost is read from what the tool imported.
"""

import argparse
import dataclasses
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from exporters import load_clip
from exporters.clip import Clip
from exporters.coordinates import to_y_up_meters
from exporters.meshes import meshes_of
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.tools.expected import moments, worst_error
from tests.tools.playing import Played, play_in_blender, play_in_three

SUFFIXES = (".usda", ".usdc", ".usdz", ".glb")
MESHES = ("quads", "surface", "both")
SPLATS = {
    ".glb, splats at rest": (".glb", ExportOptions(splats="rest", faces=4000)),
    ".glb, splats in parts": (".glb", ExportOptions(splats="parts", faces=4000)),
    ".usdc, splats beside the mesh": (".usdc", ExportOptions(usd_splats="sibling")),
    ".usdc, splats as a payload": (".usdc", ExportOptions(usd_splats="payload")),
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table."""

    tool: str
    file: str
    content: str
    at_keys: str
    between: str
    notes: str

    def __str__(self) -> str:
        return f"| {' | '.join(dataclasses.astuple(self))} |"


def played_by_all(clip: Clip, path: Path) -> dict[str, Played]:
    """Play a file at the keys and between them, in every tool."""
    keys_s, halves_s = moments(clip)
    times_s = keys_s + halves_s
    return {
        "Blender 5.0.1": play_in_blender(path, times_s, fps=clip.fps),
        "three.js 0.187": play_in_three(path, times_s),
    }


def mesh_rows(clip: Clip, suffix: str, mesh_choice: str, folder: Path) -> Iterator[Row]:
    """Write and play one file of meshes."""
    options = ExportOptions(mesh=mesh_choice, faces=4000)
    path = folder / f"clip{suffix}"
    export_clip(clip, path, options)
    keys_s, halves_s = moments(clip)
    for tool, played in played_by_all(clip, path).items():
        worst = [0.0, 0.0]
        for mesh in meshes_of(clip, options):
            tracks = played.meshes[mesh.name]
            for part, times_s in enumerate((keys_s, halves_s)):
                span = slice(None, len(keys_s)) if part == 0 else slice(len(keys_s), None)
                error = worst_error(clip, mesh, tracks.at(span), times_s)
                worst[part] = max(worst[part], error)
        at_keys, between = (f"{value:.0e}" for value in worst)
        yield Row(
            tool=tool,
            file=suffix,
            content=mesh_choice,
            at_keys=at_keys,
            between=between,
            notes=mesh_notes(tool, suffix, played),
        )


def mesh_notes(tool: str, suffix: str, played: Played) -> str:
    """Say what a tool did with everything that is not motion."""
    if tool.startswith("three"):
        has_colors = all(mesh["has_colors"] for mesh in played.scene["meshes"])
        return "colors" if has_colors else "colors of the vertices are lost: the mean color"
    kinds = list(played.scene["objects"].values())
    notes = ["colors" if all(played.scene["materials"].values()) else "no material"]
    notes.append("camera" if "CAMERA" in kinds else "no camera")
    if played.points:
        off = ", ".join(played.scene["switched_off"])
        notes.append(f"splats as loose points in the collection {off}, switched off")
    return ", ".join(notes)


def splat_rows(clip: Clip, content: str, folder: Path) -> Iterator[Row]:
    """Write and play one file with splats; only points can be compared."""
    suffix, options = SPLATS[content]
    path = folder / f"clip{suffix}"
    export_clip(clip, path, options)
    key_count = len(clip.tracks)
    by_tool = played_by_all(clip, path)
    for tool, played in by_tool.items():
        row = Row(
            tool=tool,
            file=suffix,
            content=content.partition(", ")[2],
            at_keys="-",
            between="-",
            notes="ignored",
        )
        if played.points and options.splats == "rest":
            row = dataclasses.replace(row, notes="points, do not move")
        elif played.points:
            errors = part_errors(clip, played, by_tool["three.js 0.187"])
            row = dataclasses.replace(
                row,
                at_keys=f"{errors[:key_count].max():.0e}",
                between=f"{errors[key_count:].max():.0e}",
                notes=f"{len(played.points)} sets of points on moving nodes",
            )
        yield row


def part_errors(clip: Clip, played: Played, at_rest: Played) -> np.ndarray:
    """Return how far the worst center is off at each moment, in diagonals, shape (T,).

    Args:
        clip: What was written.
        played: The points of one tool.
        at_rest: The same points in a tool that tells where they are at rest: Blender does not. Both
            keep the names of the pieces and the order of the points in them.
    """
    clip = to_y_up_meters(clip)
    names = sorted(at_rest.points)
    rest = np.concatenate([at_rest.points[name].rest for name in names])
    posed = np.concatenate([played.points[name].posed for name in names], axis=1)
    keys_s, halves_s = moments(clip)
    truth = np.stack([clip.pose_at(time_s).positions for time_s in keys_s + halves_s])
    diagonal = np.linalg.norm(np.ptp(clip.splats.positions, axis=0))
    offsets, gaussians = cKDTree(clip.splats.positions).query(rest)
    assert offsets.max() < 1e-5 * diagonal, "the tool moved the pieces at rest"
    return np.linalg.norm(posed - truth[:, gaussians], axis=2).max(axis=1) / diagonal


def main(clip_path: Path) -> None:
    """Print the table."""
    clip = load_clip(clip_path)
    out = sys.stdout
    out.write("| tool | file | content | at keys | between keys | what else |\n")
    out.write("|---|---|---|---|---|---|\n")
    with tempfile.TemporaryDirectory() as work:
        for suffix in SUFFIXES:
            for mesh_choice in MESHES:
                for row in mesh_rows(clip, suffix, mesh_choice, Path(work)):
                    out.write(f"{row}\n")
                    out.flush()
        for content in SPLATS:
            for row in splat_rows(clip, content, Path(work)):
                out.write(f"{row}\n")
                out.flush()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clip", metavar="CLIP", type=Path)
    main(parser.parse_args().clip)
