"""The golden clips, the layouts they are written to, and how each file is read back."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from exporters.clip import Clip
from exporters.options import ExportOptions
from tests.golden import dump_gltf, dump_ply, dump_usd
from tests.golden.semantics import outline
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


def steady() -> Clip:
    """The hinge at a steady pace for twelve frames, to 9 degrees, then at rest for three.

    Only the keys at frames 0, 12 and 15 are needed: the others lie on the arcs between them.
    """
    clip = clips.hinge()
    half_angles = np.deg2rad(4.5) * np.minimum(np.arange(16) / 12, 1.0)
    quats_wxyz = np.zeros((16, 2, 4))
    quats_wxyz[:, 0, 0] = 1.0
    quats_wxyz[:, 1, 0], quats_wxyz[:, 1, 3] = np.cos(half_angles), np.sin(half_angles)
    tracks = dataclasses.replace(
        clip.tracks,
        times_s=np.arange(16) / 24,
        translations=np.tile(clip.rig.rest_translations, (16, 1, 1)),
        quats_wxyz=quats_wxyz,
    )
    return dataclasses.replace(clip, tracks=tracks, source_frames=(), camera=None)


CLIPS: dict[str, Callable[[], Clip]] = {
    "static": clips.static,
    "hinge": clips.hinge,
    "chain": clips.chain,
    "z_up_centimeters": clips.z_up_centimeters,
    "random": small_random,
    "odd_name": odd_name,
    "steady": steady,
}
"""Every golden clip by name."""

CLIPS_OF_RIGS = ("static", "hinge", "chain", "z_up_centimeters", "random", "odd_name")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Layout:
    """One way to write a clip, and which clips are golden in it."""

    describe: Callable[[Clip, Path, ExportOptions], dict]
    """Exports a clip into an empty folder and describes what was written."""
    clips: tuple[str, ...]
    options: ExportOptions = dataclasses.field(default_factory=ExportOptions)

    def __call__(self, clip: Clip, folder: Path) -> dict:
        """Describe a clip in this layout."""
        return self.describe(clip, folder, self.options)


def _dump_gltf(clip: Clip, folder: Path, options: ExportOptions) -> dict:
    from exporters.gltf.write import write_gltf

    write_gltf(clip, folder / "clip.glb", options)
    return dump_gltf.dump(folder / "clip.glb", _moments_s(clip, options))


def _dump_usd(clip: Clip, folder: Path, options: ExportOptions) -> dict:
    from exporters.usd.write import write_usd_rig

    written = write_usd_rig(clip, folder / "clip.usdc", options)
    described = dump_usd.dump(folder / "clip.usdc", _moments_s(clip, options) or None)
    beside = [path.name for path in written[1:]]
    return described | ({"beside": beside} if beside else {})


def _dump_cache(clip: Clip, folder: Path, options: ExportOptions) -> dict:
    from exporters.usd.cache import write_usd_cache

    write_usd_cache(clip, folder / "clip_gaussians.usdc", options)
    return dump_usd.dump(folder / "clip_gaussians.usdc")


def _dump_ply(clip: Clip, folder: Path, options: ExportOptions) -> dict:
    from exporters.ply.sequence import write_ply_sequence

    write_ply_sequence(clip, folder / "clip_gaussians", options)
    return dump_ply.dump(folder / "clip_gaussians")


def _outline_gltf(clip: Clip, folder: Path, options: ExportOptions) -> dict:
    return outline(_dump_gltf(clip, folder, options))


def _outline_usd(clip: Clip, folder: Path, options: ExportOptions) -> dict:
    return outline(_dump_usd(clip, folder, options))


BAKED = ("chain", "random")
"""Clips whose caches are golden too; the caches repeat every Gaussian in every frame."""

_SURFACE = ExportOptions(mesh="surface", faces=100, splats="none", camera=False)
_FEWER_KEYS = ExportOptions(tolerance=1e-3, splats="none")

FORMATS: dict[str, Layout] = {
    "gltf": Layout(describe=_dump_gltf, clips=CLIPS_OF_RIGS),
    "usd": Layout(describe=_dump_usd, clips=CLIPS_OF_RIGS),
    "cache": Layout(describe=_dump_cache, clips=BAKED),
    "ply": Layout(describe=_dump_ply, clips=BAKED),
    "gltf_parts": Layout(
        describe=_dump_gltf, clips=BAKED, options=ExportOptions(mesh="none", splats="parts")
    ),
    "usd_sibling": Layout(
        describe=_dump_usd, clips=BAKED, options=ExportOptions(mesh="none", usd_splats="sibling")
    ),
    "usd_payload": Layout(
        describe=_dump_usd, clips=("chain",), options=ExportOptions(usd_splats="payload")
    ),
    "cache_rotated": Layout(
        describe=_dump_cache,
        clips=("z_up_centimeters",),
        options=ExportOptions(rotate_sh=True, fps=2.0),
    ),
    "gltf_surface": Layout(describe=_outline_gltf, clips=("hinge",), options=_SURFACE),
    "usd_surface": Layout(describe=_outline_usd, clips=("hinge",), options=_SURFACE),
    "gltf_fewer_keys": Layout(describe=_dump_gltf, clips=("steady",), options=_FEWER_KEYS),
    "usd_fewer_keys": Layout(describe=_dump_usd, clips=("steady",), options=_FEWER_KEYS),
}
"""Export a clip into an empty folder and describe what was written, by name of the layout."""

GOLDENS = [(name, form) for form, layout in FORMATS.items() for name in layout.clips]
"""All (clip, layout) pairs that have a golden file."""


def golden_path(name: str, form: str) -> Path:
    """Return where the golden file of a clip and a format lies."""
    return DATA_FOLDER / f"{name}.{form}.json"


def _moments_s(clip: Clip, options: ExportOptions) -> list[float]:
    """Return the keys and the middles between them; none if there are no quads to play.

    Of many keys, seven moments from first to last.
    """
    if options.mesh != "quads":
        return []
    keys = clip.tracks.times_s
    if len(keys) > 4:
        return np.linspace(0.0, keys[-1], 7).tolist()
    return sorted(np.concatenate([keys, (keys[1:] + keys[:-1]) / 2]).tolist())
