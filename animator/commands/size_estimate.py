"""How large the outputs get, from counts alone."""

import dataclasses
from pathlib import Path

from animator.commands.outputs import OutputPlan
from exporters.clip_io import SUFFIX as CLIP_SUFFIX

_GLTF_SUFFIXES = (".glb", ".gltf")
_FLOAT = 4


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClipCounts:
    """What the size of a clip depends on."""

    gaussians: int
    sh_coeffs: int
    """Coefficients a channel: 1, 4, 9 or 16."""
    joints: int
    """Joints, root included."""
    keys: int
    """Frames on the time line, in-betweens included."""


def estimate_sizes(plan: OutputPlan, counts: ClipCounts) -> dict[Path, int]:
    """Estimate the size of each large output [bytes].

    The caches and the clip are exact to a per cent, for their arrays are not compressed; the rigged
    assets are bounds from above, since .usdc compresses its integers.
    """
    sizes = {path: _asset_bytes(path, counts) for path in plan.assets}
    if plan.ply_folder is not None:
        sizes[plan.ply_folder] = counts.keys * counts.gaussians * _ply_row_bytes(counts)
    if plan.usd_cache is not None:
        sizes[plan.usd_cache] = _usd_cache_bytes(counts)
    if plan.clip is not None:
        assert plan.clip.name.endswith(CLIP_SUFFIX)
        sizes[plan.clip] = _clip_bytes(counts)
    return sizes


def describe_bytes(size_bytes: int) -> str:
    """Write a size the way file managers do, in powers of ten."""
    size = float(size_bytes)
    for unit in ("bytes", "kB", "MB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if size >= 10 or unit == "bytes" else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.1f} GB"


def _ply_row_bytes(counts: ClipCounts) -> int:
    """Position, normal, color, opacity, scale, rotation as float32."""
    return _FLOAT * (3 + 3 + 3 * counts.sh_coeffs + 1 + 3 + 4)


def _usd_cache_bytes(counts: ClipCounts) -> int:
    """Positions and orientations a key; scales, opacities and colors once."""
    sampled = counts.keys * _FLOAT * (3 + 4)
    return counts.gaussians * (sampled + _FLOAT * (3 + 1 + 3 * counts.sh_coeffs))


def _clip_bytes(counts: ClipCounts) -> int:
    splat = _FLOAT * (3 + 4 + 3 + 1 + 3 * counts.sh_coeffs)
    skin = 4 * (4 + 4)
    return counts.gaussians * (splat + skin) + _track_bytes(counts, number_bytes=8)


def _track_bytes(counts: ClipCounts, *, number_bytes: int) -> int:
    return counts.keys * counts.joints * number_bytes * (3 + 4)


def _asset_bytes(path: Path, counts: ClipCounts) -> int:
    """Four vertices a Gaussian with their skin; glTF adds the rest splats."""
    tracks = _track_bytes(counts, number_bytes=_FLOAT)
    if path.suffix.lower() in _GLTF_SUFFIXES:
        vertex = _FLOAT * (3 + 3 + 4) + 4 + 4 * _FLOAT
        triangles = 6 * _FLOAT
        splat = _FLOAT * (3 + 4 + 3 + 1 + 4 + 3 * counts.sh_coeffs)
        return counts.gaussians * (4 * vertex + triangles + splat) + tracks
    vertex = _FLOAT * (3 + 3 + 1 + 4 + 4)
    binary = counts.gaussians * (4 * vertex + 5 * _FLOAT) + tracks
    return 3 * binary if path.suffix.lower() == ".usda" else binary
