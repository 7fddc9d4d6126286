"""The columns of an INRIA Gaussian PLY file (Kerbl et al. 2023, `GaussianModel.save_ply`).

Scales are logarithms, opacities logits, rotations wxyz, the higher spherical harmonics channel by
channel (all red coefficients, then green, then blue).
"""

import logging

import numpy as np

from exporters.clip import Clip, Posed

OPACITY_MARGIN = 1e-6
"""Opacities are kept this far from 0 and 1, where the logit is infinite."""

_CENTERS = slice(0, 3)
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
    count, sh_count = splats.sh_coeffs.shape[:2]
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
            splats.sh_coeffs[:, 1:].transpose(0, 2, 1).reshape(count, 3 * (sh_count - 1)),
            np.log(opacities / (1 - opacities))[:, None],
            np.log(splats.scales),
            splats.quats_wxyz,
        ],
        axis=1,
    )
    return np.ascontiguousarray(rows, dtype="<f4")


def put_pose(rows: np.ndarray, posed: Posed) -> None:
    """Overwrite centers and rotations in place, the only columns that change with the frame."""
    rows[:, _CENTERS] = posed.positions
    rows[:, _ROTATIONS] = posed.quats_wxyz
