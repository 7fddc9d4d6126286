"""Other writers of USD splats on the same Gaussians: whole processes all, ours too.

NVIDIA's `usd-convert-gsplat` turns one PLY file into USD, `fourdgs` a sequence into time samples.
Each is installed once into a virtual environment of its own; NVIDIA's pins its numpy.
"""

import dataclasses
import os
import statistics
import subprocess
import sys
import time
import venv
from pathlib import Path

import numpy as np

from benchmarks.reporting import environment, particle_field, table
from benchmarks.synthetic import synthetic_clip
from exporters import export_clip, save_clip
from exporters.clip import Tracks

NVIDIA = ("usd-convert-gsplat==0.1.15", "usd-core==26.11")
FOURDGS = ("fourdgs==0.6.0", "usd-core==26.11")


def report_peers(folder: Path, pairs: int) -> None:
    """Print how other writers of USD splats do on the same Gaussians, whole processes all."""
    few = synthetic_clip(gaussians=100_000, frames=4, joints=200)
    one_key = dataclasses.replace(
        few,
        tracks=Tracks(
            times_s=[0.0],
            translations=few.tracks.translations[:1],
            quats_wxyz=few.tracks.quats_wxyz[:1],
        ),
    )
    rows = [("100k Gaussians, degree 3", "MB", "s", "CPU s")]

    def compare(label: str, commands: list[list[str]], target: Path) -> float:
        runs = [_run_all(commands) for _ in range(pairs)]
        wall, cpu = (statistics.median(values) for values in zip(*runs, strict=True))
        rows.append((label, f"{target.stat().st_size / 1e6:.1f}", f"{wall:.1f}", f"{cpu:.2f}"))
        return cpu

    for name, clip in (("one", one_key), ("few", few)):
        save_clip(clip, folder / f"{name}.splatimate.npz")
        export_clip(clip, folder / f"{name}_gaussians")
    ours = [sys.executable, "-m", "exporters"]

    nvidia = _environment_with(folder / "venv_nvidia", NVIDIA) / "usd-convert-gsplat"
    source, theirs = folder / "one_gaussians" / "clip_0000.ply", folder / "nvidia.usdc"
    our_file = folder / "one_gaussians.usdc"
    our_s = compare(
        "1 frame, ours", [[*ours, str(folder / "one.splatimate.npz"), str(our_file)]], our_file
    )
    their_s = compare(
        "1 frame, usd-convert-gsplat 0.1.15",
        [[str(nvidia), "-i", str(source), "-o", str(theirs)]],
        theirs,
    )

    fourdgs = str(_environment_with(folder / "venv_fourdgs", FOURDGS) / "fourdgs")
    our_clip, our_animated = folder / "few.splatimate.npz", folder / "few_gaussians.usdc"
    packed, their_animated = folder / "few.4dgs", folder / "fourdgs.usdc"
    compare("4 frames, ours", [[*ours, str(our_clip), str(our_animated)]], our_animated)
    compare(
        "4 frames, fourdgs 0.6.0: convert, to-usd --animated",
        [
            [fourdgs, "convert", str(folder / "few_gaussians"), "-o", str(packed), "--fps", "24"],
            [
                *(fourdgs, "to-usd", str(packed), "--animated", "--fps", "24"),
                *("--coordinate-system", "y-up-right-handed", "-o", str(their_animated)),
            ],
        ],
        their_animated,
    )
    sys.stdout.write(table(rows))
    sys.stdout.write(
        f"NVIDIA's takes {their_s / our_s:.1f} times the CPU time of ours; arrays differ by at "
        f"most {_field_difference(our_file, theirs):.1e}.\n"
    )


def _environment_with(folder: Path, packages: tuple[str, ...]) -> Path:
    """Make a virtual environment, once; return the folder of its programs."""
    programs = folder / "bin"
    if not (folder / "ready").exists():
        venv.create(folder, with_pip=True)
        install = [str(programs / "python"), "-m", "pip", "install", "-q", *packages]
        subprocess.run(install, check=True)
        (folder / "ready").touch()
    return programs


def _run_all(commands: list[list[str]]) -> tuple[float, float]:
    """Run commands one after another; return wall and CPU seconds of all."""
    wall, before = time.perf_counter(), os.times()
    for command in commands:
        subprocess.run(command, check=True, capture_output=True, env=environment())
    after = os.times()
    cpu = after.children_user + after.children_system
    cpu -= before.children_user + before.children_system
    return time.perf_counter() - wall, cpu


def _field_difference(ours: Path, theirs: Path) -> float:
    """Return the largest difference of any array; quaternions up to their sign."""
    largest = 0.0
    our_prim, their_prim = particle_field(ours).GetPrim(), particle_field(theirs).GetPrim()
    for name in (
        *("positions", "orientations", "scales", "opacities"),
        "radiance:sphericalHarmonicsCoefficients",
    ):
        values = []
        for prim in (our_prim, their_prim):
            attribute = prim.GetAttribute(name)
            values.append(np.array(attribute.Get(0.0), dtype=np.float64))
        left, right = values
        if name == "orientations":
            flips = np.where((left * right).sum(axis=1) < 0, -1, 1)
            right = right * flips[:, None]
        largest = max(largest, float(np.abs(left - right).max()))
    return largest
