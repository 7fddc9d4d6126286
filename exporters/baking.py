"""The clip frame by frame: what a cache holds, whatever its format."""

import dataclasses
import logging
from collections.abc import Callable, Iterator

import numpy as np

from exporters import harmonics, keyframes, quaternions
from exporters.clip import Clip, Posed

Progress = Callable[[int, int], None]
"""Called with the frames done and their total."""

_log = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class BakedFrame:
    """The Gaussians at one whole time code."""

    code: int
    """Time code, 0, 1, ...; at `code / fps` seconds."""
    posed: Posed
    """Centers and rotations; each rotation has the sign nearest to its last frame's."""
    sh_coeffs: np.ndarray | None
    """Spherical harmonics turned with each Gaussian, shape (N, K, 3); None if they stay as at rest."""


def bake_frames(
    clip: Clip, progress: Progress | None = None, *, rotate_sh: bool = False
) -> Iterator[BakedFrame]:
    """Pose the clip at every whole time code, one frame in memory at a time.

    Spherical harmonics are turned with the Gaussians only on demand: they must then be stored again
    for every frame, which makes a cache of degree 3 eight times as large. Where they are not turned
    and that shows, the log says so.

    Args:
        clip: A valid clip.
        progress: Called after each frame is consumed.
        rotate_sh: Whether to turn spherical harmonics, if there are any beyond the base color.
    """
    total = keyframes.frame_count(clip)
    rotate_sh = rotate_sh and clip.splats.sh_degree > 0
    if clip.splats.sh_degree > 0 and total > 1 and not rotate_sh:
        _log.warning(
            "%s: the view-dependent color of %d Gaussians (spherical harmonics of degree %d) stays "
            "fixed to the world while they turn; their base color is exact",
            clip.name,
            len(clip.splats),
            clip.splats.sh_degree,
        )
    reference_wxyz = clip.splats.quats_wxyz
    for code in range(total):
        posed = clip.pose_at(code / clip.fps)
        quats_wxyz = keyframes.align_signs(posed.quats_wxyz, reference_wxyz)
        reference_wxyz = quats_wxyz
        posed = dataclasses.replace(posed, quats_wxyz=quats_wxyz)
        sh_coeffs = _turned_harmonics(clip, posed) if rotate_sh else None
        yield BakedFrame(code=code, posed=posed, sh_coeffs=sh_coeffs)
        if progress is not None:
            progress(code + 1, total)


def _turned_harmonics(clip: Clip, posed: Posed) -> np.ndarray:
    """Turn the color pattern of each Gaussian as the Gaussian itself turned since rest."""
    turns_wxyz = quaternions.multiply(
        posed.quats_wxyz, quaternions.conjugate(clip.splats.quats_wxyz)
    )
    return harmonics.rotate_each(clip.splats.sh_coeffs, turns_wxyz)
