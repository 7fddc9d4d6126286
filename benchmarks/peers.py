"""Other writers of USD splats on the same Gaussians: whole processes all, ours too.

NVIDIA's `usd-convert-gsplat` turns one PLY file into USD, `fourdgs` a sequence into time samples.
Each is installed once into a virtual environment of its own; NVIDIA's pins its numpy.
"""

import os
import statistics
import subprocess
import sys
import time
import venv
from pathlib import Path

import numpy as np

from benchmarks.reporting import environment, open_particle_field, write_head, write_row
from benchmarks.synthetic import synthetic_clip
from exporters import export_clip, save_clip

NVIDIA = ("usd-convert-gsplat==0.1.15", "usd-core==26.11")
FOURDGS = ("fourdgs==0.6.0", "usd-core==26.11")


OUR_CONVERSION = (
    "import exporters, exporters.usd.cache as cache\n"
    "begin = time.process_time()\n"
    "cache.write_usd_cache(exporters.load_clip(sys.argv[1]), sys.argv[2])\n"
)
NVIDIA_CONVERSION = (
    "from usd_convert_gsplat import convertPlyUSD\n"
    "begin = time.process_time()\n"
    "convertPlyUSD(sys.argv[1], sys.argv[2])\n"
)
"""File to file, without the start of the interpreter and the imports."""


def report_nvidia(folder: Path, pairs: int) -> None:
    """Print how NVIDIA's converter does on one frame."""
    clip = synthetic_clip(gaussians=100_000, frames=1, joints=200)
    our_source, our_target = folder / "one.splatimate.npz", folder / "one_gaussians.usdc"
    their_folder, their_target = folder / "one_gaussians", folder / "nvidia.usdc"
    save_clip(clip, our_source)
    (their_source,) = export_clip(clip, their_folder)
    programs = _environment_with(folder / "venv_nvidia", NVIDIA)
    convert = str(programs / "usd-convert-gsplat")
    _write_head()
    _compare(
        "1 frame, ours",
        [[sys.executable, "-m", "exporters", str(our_source), str(our_target)]],
        our_target,
        pairs,
    )
    _compare(
        "1 frame, usd-convert-gsplat 0.1.15",
        [[convert, "-i", str(their_source), "-o", str(their_target)]],
        their_target,
        pairs,
    )
    ratios = [
        _conversion_s(str(programs / "python"), NVIDIA_CONVERSION, their_source, their_target)
        / _conversion_s(sys.executable, OUR_CONVERSION, our_source, our_target)
        for _ in range(pairs)
    ]
    sys.stdout.write(
        f"\nFile to file, without start and imports, NVIDIA's takes {statistics.median(ratios):.1f} "
        "times the CPU time of ours.\n"
        f"Arrays differ by at most {_field_difference(our_target, their_target):.1e}.\n"
    )


def report_fourdgs(folder: Path, pairs: int) -> None:
    """Print how fourdgs does on four frames."""
    clip = synthetic_clip(gaussians=100_000, frames=4, joints=200)
    source, target = folder / "few.splatimate.npz", folder / "few_gaussians.usdc"
    sequence, packed, their_target = (
        folder / name for name in ("few_gaussians", "few.4dgs", "fourdgs.usdc")
    )
    save_clip(clip, source)
    export_clip(clip, sequence)
    fourdgs = str(_environment_with(folder / "venv_fourdgs", FOURDGS) / "fourdgs")
    _write_head()
    _compare(
        "4 frames, ours",
        [[sys.executable, "-m", "exporters", str(source), str(target)]],
        target,
        pairs,
    )
    _compare(
        "4 frames, fourdgs 0.6.0: convert, to-usd --animated",
        [
            [fourdgs, "convert", str(sequence), "-o", str(packed), "--fps", "24"],
            [
                *(fourdgs, "to-usd", str(packed), "--animated", "--fps", "24"),
                *("--coordinate-system", "y-up-right-handed", "-o", str(their_target)),
            ],
        ],
        their_target,
        pairs,
    )


def _write_head() -> None:
    write_head("100k Gaussians, degree 3, whole processes", "MB", "s", "CPU s")


def _compare(label: str, commands: list[list[str]], target: Path, pairs: int) -> None:
    runs = [_run_all(commands) for _ in range(pairs)]
    wall, cpu = (statistics.median(values) for values in zip(*runs, strict=True))
    write_row(label, f"{target.stat().st_size / 1e6:.1f}", f"{wall:.1f}", f"{cpu:.2f}")


def _conversion_s(python: str, script: str, source: Path, target: Path) -> float:
    """Return the CPU seconds of a conversion alone."""
    whole = f"import sys, time\n{script}print('CPU', time.process_time() - begin)\n"
    command = [python, "-c", whole, str(source), str(target)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment())
    return float(done.stdout.rsplit("CPU ", 1)[1])


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
    stages, fields = zip(*map(open_particle_field, (ours, theirs)), strict=True)
    for name in (
        *("positions", "orientations", "scales", "opacities"),
        "radiance:sphericalHarmonicsCoefficients",
    ):
        attributes = [field.GetPrim().GetAttribute(name) for field in fields]
        left, right = (np.array(attribute.Get(0.0), np.float64) for attribute in attributes)
        if name == "orientations":
            flips = np.where((left * right).sum(axis=1) < 0, -1, 1)
            right = right * flips[:, None]
        largest = max(largest, float(np.abs(left - right).max()))
    del stages
    return largest
