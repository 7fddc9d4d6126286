"""How large the outputs get, from counts alone."""

import dataclasses
from pathlib import Path

from animator.commands.outputs import OutputPlan
from exporters.clip_io import SUFFIX as CLIP_SUFFIX
from exporters.companions import payload_path
from exporters.options import ExportOptions

_GLTF_SUFFIXES = (".glb", ".gltf")
_TEXT_FACTOR = 3  # a number in text takes about three times its four bytes
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
    cached: int
    """Frames in a cache: as many, unless it is written at another rate."""


def estimate_sizes(plan: OutputPlan, counts: ClipCounts, choices: ExportOptions) -> dict[Path, int]:
    """Estimate the size of each large output [bytes].

    The caches and the clip are exact to a per cent, for their arrays are not compressed; the rigged
    assets are bounds from above, since .usdc compresses its integers.
    """
    sizes = {path: _asset_bytes(path, counts, choices) for path in plan.assets}
    payloads = {payload_path(path) for path in plan.assets}
    cache_bytes = _usd_cache_bytes(counts, choices)
    sizes |= {path: cache_bytes for path in plan.companions if path in payloads}
    if plan.ply_folder is not None:
        sizes[plan.ply_folder] = counts.cached * counts.gaussians * _ply_row_bytes(counts)
    if plan.usd_cache is not None:
        sizes[plan.usd_cache] = cache_bytes
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


def _usd_cache_bytes(counts: ClipCounts, choices: ExportOptions) -> int:
    """Positions and orientations a frame; scales, opacities and colors once, if they do not turn."""
    number = _FLOAT // 2 if choices.precision == "half" else _FLOAT
    colors = 3 * counts.sh_coeffs * number
    is_turning = choices.rotate_sh and counts.sh_coeffs > 1
    sampled = 3 * _FLOAT + 4 * number + (colors if is_turning else 0)
    once = (3 + 1) * _FLOAT + (0 if is_turning else colors)
    return counts.gaussians * (counts.cached * sampled + once)


def _clip_bytes(counts: ClipCounts) -> int:
    splat = _FLOAT * (3 + 4 + 3 + 1 + 3 * counts.sh_coeffs)
    skin = 4 * (4 + 4)
    return counts.gaussians * (splat + skin) + _track_bytes(counts, number_bytes=8)


def _track_bytes(counts: ClipCounts, *, number_bytes: int) -> int:
    return counts.keys * counts.joints * number_bytes * (3 + 4)


def _asset_bytes(path: Path, counts: ClipCounts, choices: ExportOptions) -> int:
    """Meshes with their skin, the tracks, and the splats in them."""
    if path.suffix.lower() in _GLTF_SUFFIXES:
        return _gltf_bytes(counts, choices)
    size = _usd_mesh_bytes(counts, choices) + _track_bytes(counts, number_bytes=_FLOAT)
    is_package = path.suffix.lower() == ".usdz"
    if choices.usd_splats == "sibling" or (choices.usd_splats == "payload" and is_package):
        size += _usd_cache_bytes(counts, choices)
    return _TEXT_FACTOR * size if path.suffix.lower() == ".usda" else size


def _gltf_bytes(counts: ClipCounts, choices: ExportOptions) -> int:
    """Positions, normals, colors (four 16-bit numbers), joints and weights a vertex."""
    vertices, triangles = _mesh_counts(counts, choices)
    vertex = _FLOAT * (3 + 3 + 2) + 2 * 4 + _FLOAT * 4
    splat = 0 if choices.splats == "none" else _FLOAT * (3 + 4 + 3 + 1 + 2 + 3 * counts.sh_coeffs)
    tracks = _track_bytes(counts, number_bytes=_FLOAT)
    return vertices * vertex + triangles * 3 * _FLOAT + counts.gaussians * splat + tracks


def _usd_mesh_bytes(counts: ClipCounts, choices: ExportOptions) -> int:
    """Positions, normals or opacities, colors, joints and weights a vertex; corners a face."""
    vertices, triangles = _mesh_counts(counts, choices)
    return vertices * _FLOAT * (3 + 3 + 3 + 4 + 4) + triangles * 4 * _FLOAT


def _mesh_counts(counts: ClipCounts, choices: ExportOptions) -> tuple[int, int]:
    """Return vertices and triangles; a closed surface has half as many vertices as triangles."""
    vertices = triangles = 0
    if choices.mesh in ("quads", "both"):
        vertices, triangles = 4 * counts.gaussians, 2 * counts.gaussians
    if choices.mesh in ("surface", "both"):
        vertices, triangles = vertices + choices.faces // 2, triangles + choices.faces
    return vertices, triangles
