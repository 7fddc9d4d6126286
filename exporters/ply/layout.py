"""The columns of an INRIA Gaussian PLY file (Kerbl et al. 2023, `GaussianModel.save_ply`).

Scales are logarithms, opacities logits, rotations wxyz, the higher spherical harmonics channel by
channel (all red coefficients, then green, then blue).
"""

import logging

import numpy as np

from exporters.baking import BakedFrame
from exporters.clip import Clip

OPACITY_MARGIN = 1e-6
"""Opacities are kept this far from 0 and 1, where the logit is infinite."""

_CENTERS = slice(0, 3)
_FIRST_REST = 9  # after centers, normals and the base color
_ROTATIONS = slice(-4, None)

_log = logging.getLogger(__name__)


def column_names(sh_count: int) -> tuple[str, ...]:
    """Return the property names in file order for K coefficients a channel: 17 + 3 (K - 1)."""
    return (
        *("x", "y", "z", "nx", "ny", "nz"),
        *(f"f_dc_{i}" for i in range(3)),
        *(f"f_rest_{i}" for i in range(3 * (sh_count - 1))),
        "opacity",
        *(f"scale_{i}" for i in range(3)),
        *(f"rot_{i}" for i in range(4)),
    )


def header(splat_count: int, sh_count: int) -> bytes:
    """Return the header: the few lines every reader knows, no comments (some readers stumble)."""
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {splat_count}",
        *(f"property float {name}" for name in column_names(sh_count)),
        "end_header",
    ]
    return ("\n".join(lines) + "\n").encode("ascii")


def rest_rows(clip: Clip) -> np.ndarray:
    """Return the rows of the rest pose, little-endian float32, shape (N, columns).

    Opacities of 0 and 1 become the nearest ones with a finite logit; the log says how many.
    """
    splats = clip.splats
    opacities = np.clip(splats.opacities.astype(np.float64), OPACITY_MARGIN, 1 - OPACITY_MARGIN)
    moved = int(np.count_nonzero(np.abs(opacities - splats.opacities) > OPACITY_MARGIN / 2))
    if moved:
        _log.warning(
            "%s: %d opacities nearer than %g to 0 or 1 were moved there; PLY stores logits",
            clip.name,
            moved,
            OPACITY_MARGIN,
        )
    rows = np.concatenate(
        [
            splats.positions,
            np.zeros_like(splats.positions),
            splats.sh_coeffs[:, 0],
            _rest_columns(splats.sh_coeffs),
            np.log(opacities / (1 - opacities))[:, None],
            np.log(splats.scales),
            splats.quats_wxyz,
        ],
        axis=1,
    )
    return np.ascontiguousarray(rows, dtype="<f4")


def put_frame(rows: np.ndarray, frame: BakedFrame) -> None:
    """Overwrite in place the only columns that change with the frame."""
    rows[:, _CENTERS] = frame.posed.positions
    rows[:, _ROTATIONS] = frame.posed.quats_wxyz
    if frame.sh_coeffs is not None:
        columns = _rest_columns(frame.sh_coeffs)
        rows[:, _FIRST_REST : _FIRST_REST + columns.shape[1]] = columns


def _rest_columns(sh_coeffs: np.ndarray) -> np.ndarray:
    """Return the harmonics beyond the base color channel by channel, shape (N, 3 (K - 1))."""
    count, sh_count = sh_coeffs.shape[:2]
    return sh_coeffs[:, 1:].transpose(0, 2, 1).reshape(count, 3 * (sh_count - 1))
