"""Gaussians from a PLY file in the INRIA layout: the only place that knows logs and logits.

Layout: `save_ply` in https://github.com/graphdeco-inria/gaussian-splatting
(scene/gaussian_model.py): centers `x y z`, `f_dc_0..2`, `f_rest_*` channel by channel, `opacity`
as a logit, `scale_0..2` as natural logarithms, `rot_0..3` as a wxyz quaternion of any length.
"""

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from scipy.special import expit

from animator.errors import InputError
from animator.scene.ply_table import read_ply_table
from animator.types import Gaussians

logger = logging.getLogger(__name__)

_POSITION = ("x", "y", "z")
_SH_BASE = ("f_dc_0", "f_dc_1", "f_dc_2")
_SCALE = ("scale_0", "scale_1", "scale_2")
_ROTATION = ("rot_0", "rot_1", "rot_2", "rot_3")
_REQUIRED = (*_POSITION, *_SH_BASE, "opacity", *_SCALE, *_ROTATION)
_SH_REST_COUNTS = (0, 9, 24, 45)
"""Three channels of (degree + 1)^2 - 1 coefficients, degrees 0 to 3."""

_CONVERT_FIRST = (
    "convert it to PLY first, for example with `npx @playcanvas/splat-transform IN OUT.ply`"
)
OTHER_SPLAT_SUFFIXES = frozenset({".spz", ".splat", ".ksplat", ".sog", ".lcc", ".gsz"})
"""Endings of splat formats that are recognized, but not read."""

_OPACITY_RANGE = (1e-12, 1 - 2.0**-24)
"""The open interval (0, 1) in float32; saturated logits (+-Inf) land on its ends."""
_MAX_LOST_SHARE = 0.5
"""Above this share of broken Gaussians the file is refused instead of mended."""


def read_ply(path: str | Path) -> Gaussians:
    """Read Gaussians in the INRIA layout, with any order of properties and any SH degree 0..3.

    Gaussians with NaN or infinite values, a zero quaternion or no size are dropped, with one
    warning that counts them. An infinite opacity logit means fully opaque or transparent.

    Args:
        path: A `.ply` file, ascii or binary.

    Returns:
        Activated Gaussians, float32, on the CPU.

    Raises:
        InputError: If the file is missing, of another format, cut off, lacks a property, or more
            than half of its Gaussians are broken.
    """
    path = Path(path)
    _require_ply(path)
    table = read_ply_table(path)
    columns = table.columns
    _require_gaussian(columns, path)
    _report_render_mode(table.comments, path)

    means = _stack(columns, _POSITION)
    rotations = _stack(columns, _ROTATION)
    with np.errstate(over="ignore", under="ignore"):  # what overflows is counted as broken below
        norms = np.linalg.norm(rotations, axis=1)
        scales = np.exp(_stack(columns, _SCALE)).astype(np.float32)
    opacities = np.clip(expit(_stack(columns, ("opacity",))[:, 0]), *_OPACITY_RANGE)
    sh_coeffs = _sh_coeffs(columns, path)

    is_broken = {
        "a non-finite position": ~_is_float32(means).all(axis=1),
        "a non-finite or zero size": ~(np.isfinite(scales) & (scales > 0)).all(axis=1),
        "a non-finite or zero quaternion": ~(np.isfinite(norms) & (norms > 1e-12)),
        "a NaN opacity": np.isnan(opacities),
        "a non-finite color": ~np.isfinite(sh_coeffs).all(axis=(1, 2)),
    }
    kept = _drop_broken(is_broken, path)
    return Gaussians(
        means=_tensor(means[kept]),
        quats_wxyz=_tensor(rotations[kept] / norms[kept, None]),
        scales=_tensor(scales[kept]),
        opacities=_tensor(opacities[kept]),
        sh_coeffs=_tensor(sh_coeffs[kept]),
    )


def _require_ply(path: Path) -> None:
    if path.suffix.lower() in OTHER_SPLAT_SUFFIXES:
        raise InputError(
            f"{path}: expected a .ply file, found a {path.suffix} file; {_CONVERT_FIRST}."
        )
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; --gaussians expects a PLY file.")
    with path.open("rb") as file:
        start = file.read(4)
    formats = {b"\x1f\x8b": "gzip (an .spz file?)", b"NGSP": "SPZ", b"PK": "zip (a .sog file?)"}
    for mark, name in formats.items():
        if start.startswith(mark):
            raise InputError(f"{path}: expected a PLY file, found {name}; {_CONVERT_FIRST}.")


def _require_gaussian(columns: Mapping[str, np.ndarray], path: Path) -> None:
    """Check that all properties are there, and say what the file is instead."""
    missing = [name for name in _REQUIRED if name not in columns]
    if not missing:
        return
    if "packed_position" in columns:
        kind = f"this is a compressed splat; {_CONVERT_FIRST}"
    elif missing == ["scale_2"]:
        kind = (
            "this is a 2D Gaussian splat (2DGS), whose Gaussians are flat; train 3D Gaussians, or "
            "add a scale_2 that is a little smaller than the others"
        )
    elif "opacity" in missing and "scale_0" in missing:
        kind = "this is a plain point cloud; give the model that was trained from it"
    else:
        kind = "export it again in the INRIA layout"
    raise InputError(
        f"{path}: element vertex: the properties {', '.join(missing)} are missing; {kind}."
    )


def _report_render_mode(comments: tuple[str, ...], path: Path) -> None:
    """Tell about training modes that change how a splat looks (Brush, Postshot)."""
    for comment in comments:
        match comment.split():
            case ["SplatRenderMode:", mode] if mode != "default":
                meaning = f"render mode {mode}"
            case ["antialiased", "1"]:
                meaning = "antialiasing"
            case _:
                continue
        logger.warning(
            "%s was trained with %s, and is drawn without: thin parts look stronger.", path, meaning
        )


def _sh_coeffs(columns: Mapping[str, np.ndarray], path: Path) -> np.ndarray:
    """Gather the spherical harmonics, shape (N, K, 3)."""
    rest_names = [name for name in columns if name.startswith("f_rest_")]
    ordered = [f"f_rest_{index}" for index in range(len(rest_names))]
    if len(rest_names) not in _SH_REST_COUNTS or set(rest_names) != set(ordered):
        raise InputError(
            f"{path}: element vertex: expected f_rest_0 to f_rest_8, _23 or _44 (or none), found "
            f"{len(rest_names)} properties f_rest_*."
        )
    base = _stack(columns, _SH_BASE, np.float32)[:, None, :]
    if not ordered:
        return base
    by_channel = _stack(columns, tuple(ordered), np.float32).reshape(len(base), 3, -1)
    return np.concatenate([base, by_channel.transpose(0, 2, 1)], axis=1)


def _drop_broken(is_broken: Mapping[str, np.ndarray], path: Path) -> np.ndarray:
    """Return which Gaussians to keep; warn about the others, by reason."""
    is_lost = np.logical_or.reduce(list(is_broken.values()))
    lost_count, count = int(is_lost.sum()), len(is_lost)
    if lost_count == 0:
        return ~is_lost
    reasons = ", ".join(
        f"{int(lost.sum()):,} with {reason}" for reason, lost in is_broken.items() if lost.any()
    )
    if lost_count > _MAX_LOST_SHARE * count:
        raise InputError(
            f"{path}: {lost_count:,} of {count:,} Gaussians are broken ({reasons}); "
            "the training diverged, or the file is damaged: export it again."
        )
    logger.warning("%s: dropped %d of %d Gaussians: %s.", path, lost_count, count, reasons)
    return ~is_lost


def _stack(
    columns: Mapping[str, np.ndarray], names: tuple[str, ...], dtype: type = np.float64
) -> np.ndarray:
    with np.errstate(over="ignore"):  # a double beyond float32 becomes Inf and is counted as such
        return np.stack([columns[name].astype(dtype) for name in names], axis=1)


def _is_float32(values: np.ndarray) -> np.ndarray:
    return np.abs(values) <= np.finfo(np.float32).max


def _tensor(values: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))
