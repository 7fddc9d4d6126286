"""Odd clips, written to every format and read back; and the same bytes, whoever writes them."""

import dataclasses
import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from plyfile import PlyData
from pxr import Usd

from exporters import keyframes
from exporters.clip import Clip, Tracks
from exporters.clip_io import load_clip
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.helpers import clips, playback

ROOT = Path(__file__).parents[2]
TOLERANCE = 1e-6
"""Of the diagonal: a few roundings of float32."""


def one_gaussian() -> Clip:
    return clips.random(gaussians=1)


def one_frame() -> Clip:
    return clips.random(keys=1)


def nothing_but_one() -> Clip:
    """One Gaussian, one joint, one key."""
    still = clips.static()
    return dataclasses.replace(
        still, splats=clips.splats(np.array([[0.3, 0.2, 0.1]])), skin=clips.skin_to([0])
    )


def thousand_frames() -> Clip:
    """Forty seconds of slow motion."""
    clip = clips.random(gaussians=5, joints=4, keys=2, sh_degree=0)
    times_s = np.arange(1000) / 24
    moments = np.linspace(0.0, clip.tracks.times_s[-1], 1000)
    poses = [keyframes.interpolate(clip.tracks, moment) for moment in moments]
    tracks = Tracks(
        times_s=times_s,
        translations=[translations for translations, _ in poses],
        quats_wxyz=[quats_wxyz for _, quats_wxyz in poses],
    )
    return dataclasses.replace(
        clip, tracks=tracks, camera=clips.camera(), source_frames=tuple(range(1000))
    )


def foreign_names() -> Clip:
    """Names that are no identifiers, and become equal where only ASCII is left."""
    clip = clips.random()
    names = ("Wurzel ö", "Gelenk ä 1", "Gelenk ü 1", "関節", "关节", "a/b: c.d")
    return dataclasses.replace(
        clip,
        name="1. Tür/椅子: #3",
        rig=dataclasses.replace(clip.rig, joint_names=names),
    )


def z_up_centimeters() -> Clip:
    return dataclasses.replace(clips.random(), up_axis="Z", meters_per_unit=0.01)


def odd_rate() -> Clip:
    """30000/1001 frames per second, as video has it."""
    clip = clips.random()
    tracks = dataclasses.replace(clip.tracks, times_s=clip.tracks.times_s * 24 * 1001 / 30000)
    return dataclasses.replace(clip, tracks=tracks, fps=30000 / 1001)


def joints(count: int) -> Callable[[], Clip]:
    return lambda: clips.random(gaussians=5, joints=count, keys=2, sh_degree=0)


ODD_CLIPS: dict[str, Callable[[], Clip]] = {
    "254 joints": joints(254),
    "255 joints": joints(255),
    "320 joints": joints(320),
    "1 frame": one_frame,
    "1 Gaussian": one_gaussian,
    "1 of all": nothing_but_one,
    "1000 frames": thousand_frames,
    "foreign names": foreign_names,
    "Z-up centimeters": z_up_centimeters,
    "29.97 fps": odd_rate,
}
USD_FORMATS = (".usda", ".usdc", ".usdz")
GLTF_FORMATS = (".glb", ".gltf")
CACHE_FORMATS = ("_gaussians", "_gaussians.usdc")


def some_times(clip: Clip) -> list[float]:
    """Return the first and the last moment and one that is no key; codes are whole for caches."""
    last = clip.tracks.times_s[-1]
    return [0.0, 0.37 * last, last]


def diagonal_m(clip: Clip) -> float:
    """Return the size of the object [m], or a Gaussian's if there is but one."""
    extent = np.linalg.norm(np.ptp(clip.splats.positions, axis=0)) or clip.splats.scales.max()
    return float(extent) * clip.meters_per_unit


@pytest.fixture(params=ODD_CLIPS.values(), ids=ODD_CLIPS.keys(), scope="module")
def clip(request) -> Clip:
    return request.param()


@pytest.fixture
def stem(tmp_path) -> Path:
    """Return a place whose names need care in URIs and asset paths."""
    return tmp_path / "Ordner ö 100% #1" / "Tür [2] 椅子"


@pytest.mark.parametrize("suffix", USD_FORMATS + GLTF_FORMATS)
def test_assets_play_as_the_clip_poses(clip, stem, suffix):
    path = export_clip(clip, stem.with_name(stem.name + suffix))[0]
    read = playback.usd_centers if suffix in USD_FORMATS else playback.gltf_centers
    # A small object far away is rounded where it is.
    scale = max(diagonal_m(clip), np.abs(playback.clip_centers(clip, 0.0)).max())
    for time_s in some_times(clip):
        found, expected = read(path, time_s), playback.clip_centers(clip, time_s)
        np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * scale)


@pytest.mark.parametrize("ending", CACHE_FORMATS)
def test_caches_hold_every_frame_as_the_clip_poses_it(clip, stem, ending):
    path = stem.with_name(stem.name + ending)
    export_clip(clip, path)
    scale = np.abs(clip.splats.positions).max()
    for code in sorted({round(t * clip.fps) for t in some_times(clip)}):
        found = cached_centers(path, code)
        expected = clip.pose_at(code / clip.fps).positions
        np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * scale)


def test_the_saved_clip_is_the_clip(clip, stem):
    (path,) = export_clip(clip, stem.with_name(f"{stem.name}.splatimate.npz"))
    again = load_clip(path)
    assert _digest(again) == _digest(clip)
    assert (again.name, again.rig.joint_names) == (clip.name, clip.rig.joint_names)


def cached_centers(path: Path, code: int) -> np.ndarray:
    if path.is_dir():
        vertices = PlyData.read(path / f"clip_{code:04d}.ply")["vertex"]
        return np.stack([vertices[axis] for axis in "xyz"], axis=1)
    stage = Usd.Stage.Open(str(path))
    (splats,) = [p for p in stage.Traverse() if p.GetTypeName() == "ParticleField3DGaussianSplat"]
    return np.array(splats.GetAttribute("positions").Get(code))


def _digest(clip: Clip) -> str:
    digest = hashlib.sha256()
    for part in (clip.splats, clip.rig, clip.skin, clip.tracks, clip.camera):
        for field in dataclasses.fields(part) if part is not None else ():
            value = getattr(part, field.name)
            digest.update(
                value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
            )
    return digest.hexdigest()


LAYOUTS: dict[str, ExportOptions] = {
    "default": ExportOptions(),
    "all": ExportOptions(mesh="quads", splats="parts", usd_splats="payload", rotate_sh=True),
    "sibling": ExportOptions(mesh="none", splats="none", usd_splats="sibling"),
    "reduced": ExportOptions(tolerance=1e-3, joint_limit=4, up_axis="Z", fps=30.0),
}
"""Every choice that makes a writer do something else."""

_WRITE_ALL = """
import sys
from pathlib import Path
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.exporters.test_round_trip import CACHE_FORMATS, GLTF_FORMATS, LAYOUTS, USD_FORMATS
from tests.helpers import clips

for name, options in LAYOUTS.items():
    for ending in (".splatimate.npz", *USD_FORMATS, *GLTF_FORMATS, *CACHE_FORMATS, "_gaussians.usdz"):
        export_clip(clips.random(), Path(sys.argv[1]) / name / f"clip{ending}", options)
surface = ExportOptions(mesh="both", faces=100, texture=True)
export_clip(clips.random(), Path(sys.argv[1]) / "clip.usdz", surface)
"""


def test_two_processes_write_the_same_bytes(tmp_path):
    """Whatever their threads, hash seeds and time zones."""
    surroundings = {
        "one": {"OMP_NUM_THREADS": "1", "PXR_WORK_THREAD_LIMIT": "1", "PYTHONHASHSEED": "1"},
        "two": {"OMP_NUM_THREADS": "2", "PXR_WORK_THREAD_LIMIT": "2", "PYTHONHASHSEED": "2"},
    }
    surroundings["one"]["TZ"], surroundings["two"]["TZ"] = "UTC+8", "UTC-9"
    running = [
        subprocess.Popen(
            [sys.executable, "-c", _WRITE_ALL, tmp_path / name], cwd=ROOT, env=os.environ | given
        )
        for name, given in surroundings.items()
    ]
    assert [process.wait() for process in running] == [0, 0]
    one, two = (_file_digests(tmp_path / name) for name in surroundings)
    assert len(one) > 8 * len(LAYOUTS)
    assert one == two


def _file_digests(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
