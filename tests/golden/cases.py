"""The golden clips, the formats they are written to, and how each file is read back."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from exporters.clip import Clip
from tests.golden import dump_gltf, dump_ply, dump_usd
from tests.helpers import clips

DATA_FOLDER = Path(__file__).parent / "data"


def small_random() -> Clip:
    """Rotated rest poses, four influences and SH degree 3, few enough to review."""
    return clips.random(gaussians=6, joints=4, keys=3)


def odd_name() -> Clip:
    """A name that is no identifier anywhere, 30 frames a second, and one key away from rest."""
    clip = clips.hinge()
    opened = dataclasses.replace(
        clip.tracks,
        times_s=[0.0],
        translations=clip.tracks.translations[1:],
        quats_wxyz=clip.tracks.quats_wxyz[1:],
    )
    return dataclasses.replace(
        clip, name="1. Tür", tracks=opened, fps=30.0, source_frames=(7,), camera=None
    )


CLIPS: dict[str, Callable[[], Clip]] = {
    "static": clips.static,
    "hinge": clips.hinge,
    "chain": clips.chain,
    "z_up_centimeters": clips.z_up_centimeters,
    "random": small_random,
    "odd_name": odd_name,
}
"""Every golden clip by name."""


def _dump_gltf(clip: Clip, folder: Path) -> dict:
    from exporters.gltf.write import write_gltf

    write_gltf(clip, folder / "clip.glb")
    return dump_gltf.dump(folder / "clip.glb", _moments_s(clip))


def _dump_usd(clip: Clip, folder: Path) -> dict:
    from exporters.usd.write import write_usd_rig

    write_usd_rig(clip, folder / "clip.usdc")
    return dump_usd.dump(folder / "clip.usdc", _moments_s(clip))


def _dump_cache(clip: Clip, folder: Path) -> dict:
    from exporters.usd.cache import write_usd_cache

    write_usd_cache(clip, folder / "clip_gaussians.usdc")
    return dump_usd.dump(folder / "clip_gaussians.usdc")


def _dump_ply(clip: Clip, folder: Path) -> dict:
    from exporters.ply.sequence import write_ply_sequence

    write_ply_sequence(clip, folder / "clip_gaussians")
    return dump_ply.dump(folder / "clip_gaussians")


FORMATS: dict[str, Callable[[Clip, Path], dict]] = {
    "gltf": _dump_gltf,
    "usd": _dump_usd,
    "cache": _dump_cache,
    "ply": _dump_ply,
}
"""Export a clip into an empty folder and describe what was written, by format."""

BAKED_CLIPS = ("chain", "random")
"""Clips whose caches are golden too; the caches repeat every Gaussian in every frame."""

GOLDENS = [
    (name, form)
    for name in CLIPS
    for form in FORMATS
    if form in ("gltf", "usd") or name in BAKED_CLIPS
]
"""All (clip, format) pairs that have a golden file."""


def golden_path(name: str, form: str) -> Path:
    """Return where the golden file of a clip and a format lies."""
    return DATA_FOLDER / f"{name}.{form}.json"


def _moments_s(clip: Clip) -> list[float]:
    """Return the keys and the middles between them."""
    keys = clip.tracks.times_s
    return sorted(np.concatenate([keys, (keys[1:] + keys[:-1]) / 2]).tolist())
