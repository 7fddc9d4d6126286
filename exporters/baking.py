"""The clip frame by frame: what a cache holds, whatever its format."""

import dataclasses
import logging
from collections.abc import Callable, Iterator

from exporters import keyframes
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


def bake_frames(clip: Clip, progress: Progress | None = None) -> Iterator[BakedFrame]:
    """Pose the clip at every whole time code, one frame in memory at a time.

    Spherical harmonics are not turned with the Gaussians: they would have to be stored again for
    every frame. The log says so where it shows.

    Args:
        clip: A valid clip.
        progress: Called after each frame is consumed.
    """
    total = keyframes.frame_count(clip)
    if clip.splats.sh_degree > 0 and total > 1:
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
        yield BakedFrame(code=code, posed=dataclasses.replace(posed, quats_wxyz=quats_wxyz))
        if progress is not None:
            progress(code + 1, total)
