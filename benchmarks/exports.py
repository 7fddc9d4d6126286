"""Measure sizes, times and errors of the written files, and compare with other writers of USD.

    python benchmarks/exports.py [--pairs 5] [--peers] [--folder FOLDER]

The clip is synthetic and seeded: 100k flat Gaussians on a closed surface, 120 frames, 200 joints.
Writing a format and writing the same bytes raw take turns, so that a busy machine disturbs both
alike; what counts is CPU time of the process (user and system), as medians. With `--peers`, NVIDIA's
`usd-convert-gsplat` and `fourdgs` are installed into virtual environments of their own in FOLDER
and run on the same Gaussians, each tool a whole process, ours too.
"""

import argparse
import dataclasses
import functools
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the readers of the tests

from benchmarks import peers
from benchmarks.reporting import environment, open_particle_field, write_head, write_row
from benchmarks.synthetic import FPS, synthetic_clip
from exporters import ExportOptions, export_clip, save_clip
from exporters.clip import Clip, Posed
from tests.helpers import playback


@dataclasses.dataclass(frozen=True, kw_only=True)
class Measured:
    """One row of the table."""

    size_mb: float
    wall_s: float
    cpu_s: float
    raw_ratio: float
    """CPU time over that of writing the same bytes raw, median of the pairs."""


def measure(write: Callable[[], tuple[Path, ...]], pairs: int) -> Measured:
    """Let `write` make files, and write the same bytes raw, in turns."""
    written = write()  # imports, and the bytes
    sizes = [path.stat().st_size for path in written]
    content = written[0].read_bytes()  # the files of a sequence are equally long
    raw_paths = [written[0].parent / f"raw_{path.name}" for path in written]

    def write_raw() -> None:
        for path in raw_paths:
            path.write_bytes(content)

    ours, raws = [], []
    for _ in range(pairs):
        for path in written:  # to give back an old file's memory takes time
            path.unlink()
        ours.append(_timed(write))
        raws.append(_timed(write_raw))
        for path in raw_paths:
            path.unlink()
    return Measured(
        size_mb=sum(sizes) / 1e6,
        wall_s=statistics.median(wall for wall, _ in ours),
        cpu_s=statistics.median(cpu for _, cpu in ours),
        raw_ratio=statistics.median(
            our / max(raw, 1e-4) for (_, our), (_, raw) in zip(ours, raws, strict=True)
        ),
    )


def _timed(action: Callable[[], object]) -> tuple[float, float]:
    """Return wall and CPU seconds."""
    wall, cpu = time.perf_counter(), time.process_time()
    action()
    return time.perf_counter() - wall, time.process_time() - cpu


def write_posed(frames: Sequence[Posed], path: Path) -> tuple[Path]:
    """Write what a cache samples, posed before, as a cache does."""
    from pxr import Usd, UsdVol, Vt

    from exporters.usd import samples, values

    stage = Usd.Stage.CreateNew(str(path))
    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, "/Splats")
    arrays = [
        samples.SampledArray(attribute=field.CreatePositionsAttr(), array_type=Vt.Vec3fArray),
        samples.SampledArray(attribute=field.CreateOrientationsAttr(), array_type=Vt.QuatfArray),
    ]
    with samples.writing_samples(stage, arrays, range(len(frames))) as write:
        for posed in frames:
            write(posed.positions, values.xyzw(posed.quats_wxyz, np.float32))
    stage.Save()
    return (path,)


def skin_error(clip: Clip, path: Path) -> float:
    """Return the largest error of a carrier, read back by an independent reader [diagonals]."""
    read = playback.gltf_centers if path.suffix == ".glb" else playback.usd_centers
    last_s = float(clip.tracks.times_s[-1])
    moments_s = (0.0, 0.37 * last_s, last_s)
    apart = [read(path, moment) - playback.clip_centers(clip, moment) for moment in moments_s]
    return float(np.linalg.norm(apart, axis=2).max() / _diagonal(clip))


def cache_error(clip: Clip, path: Path) -> float:
    """Return the largest error of the centers in a cache [diagonals]."""
    if path.is_dir():
        files = sorted(path.iterdir())
        found = {code: _ply_centers(files[code], len(clip.splats)) for code in (0, len(files) - 1)}
    else:
        stage, field = open_particle_field(path)
        attribute = field.GetPositionsAttr()
        codes = attribute.GetTimeSamples()
        found = {code: np.array(attribute.Get(code)) for code in (codes[0], codes[-1])}
        del stage
    return max(
        float(np.linalg.norm(found[code] - clip.pose_at(code / FPS).positions, axis=1).max())
        for code in found
    ) / _diagonal(clip)


def _ply_centers(path: Path, count: int) -> np.ndarray:
    body = path.read_bytes().split(b"end_header\n", 1)[1]
    return np.frombuffer(body, "<f4").reshape(count, -1)[:, :3]


def _diagonal(clip: Clip) -> float:
    return float(np.linalg.norm(np.ptp(clip.splats.positions, axis=0)))


def peak_memory_mb(clip_path: Path, target: Path) -> float:
    """Return what writing adds to the peak memory of a fresh process [MB]; Linux only."""
    script = (
        "import sys, numpy, exporters, exporters.usd.cache\n"
        "def status(name):\n"
        "    return int(open('/proc/self/status').read().split(name + ':')[1].split()[0])\n"
        "clip = exporters.load_clip(sys.argv[1])\n"
        "open('/proc/self/clear_refs', 'w').write('5')\n"  # forget the peak of loading
        "before = status('VmRSS')\n"
        "exporters.export_clip(clip, sys.argv[2])\n"
        "print((status('VmHWM') - before) / 1024)\n"
    )
    command = [sys.executable, "-c", script, str(clip_path), str(target)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment())
    return float(done.stdout)


def report_formats(folder: Path, pairs: int) -> None:
    """Print sizes, times and errors of every format."""
    clip = synthetic_clip(gaussians=100_000, frames=120, joints=200)
    busy = synthetic_clip(gaussians=100_000, frames=240, joints=300)
    exact, loose = ExportOptions(), ExportOptions(tolerance=1e-3)
    write_head("100k Gaussians x 120 frames, 200 joints", "MB", "s", "CPU s", "x raw", "error")
    for label, subject, name, options in (
        ("PLY sequence", clip, "clip_gaussians", exact),
        ("USD cache", clip, "clip_gaussians.usdc", exact),
        ("USD cache, half", clip, "half_gaussians.usdc", ExportOptions(precision="half")),
        ("skinned USD", clip, "clip.usdc", exact),
        ("skinned USD, tolerance 0.001", clip, "loose.usdc", loose),
        ("GLB", clip, "clip.glb", exact),
        ("GLB, tolerance 0.001", clip, "loose.glb", loose),
        ("GLB without rest splats", clip, "rig.glb", ExportOptions(splats="none")),
        ("GLB, 300 joints x 240 keys", busy, "busy.glb", exact),
    ):
        target = folder / name
        export = functools.partial(export_clip, subject, target, options)
        found = measure(export, pairs)
        error = (cache_error if "_gaussians" in name else skin_error)(subject, target)
        _write_measured(label, found, error)
    frames = [clip.pose_at(code / FPS) for code in range(120)]
    target = folder / "posed_gaussians.usdc"
    write = functools.partial(write_posed, frames, target)
    found = measure(write, pairs)
    _write_measured("USD cache, posed beforehand", found, cache_error(clip, target))


def _write_measured(label: str, found: Measured, error: float) -> None:
    write_row(
        label,
        f"{found.size_mb:.1f}",
        f"{found.wall_s:.2f}",
        f"{found.cpu_s:.2f}",
        f"{found.raw_ratio:.2f}",
        f"{error:.1e}",
    )


def report_memory(folder: Path) -> None:
    """Print the peak memory of the cache for a short and a long clip."""
    write_head("frames of the USD cache", "peak MB above the loaded clip")
    for frames in (30, 240):
        clip_path = folder / f"frames_{frames}.splatimate.npz"
        save_clip(synthetic_clip(gaussians=100_000, frames=frames, joints=200), clip_path)
        peak = peak_memory_mb(clip_path, folder / f"frames_{frames}_gaussians.usdc")
        write_row(str(frames), f"{peak:.0f}")


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--peers", action="store_true", help="compare with other writers too")
    parser.add_argument("--only-peers", action="store_true", help="compare with them alone")
    parser.add_argument("--folder", type=Path, help="keep all files here; default: a temporary one")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if not given.only_peers:
            report_formats(folder, given.pairs)
            report_memory(folder)
        if given.peers or given.only_peers:
            peers.report_nvidia(folder, min(given.pairs, 3))
            peers.report_fourdgs(folder, 1)


if __name__ == "__main__":
    main()
