"""What is known of a frame once it is solved."""

import dataclasses
from collections.abc import Mapping, Sequence

from animator.types import AnchorPoses, AnchorUncertainty, Camera, RigidGroups


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameStats:
    """What the report says of one frame."""

    matches: int
    """Gaussian-to-pixel matches used."""
    reprojection_px: float
    """Median distance of matched Gaussians to their pixels after solving [px]; NaN without matches."""
    start: str
    """Which candidate started the image stage: `rest`, `previous`, `extrapolated`, `matches` or `claims`; where
    limbs were searched for with success `limb search`, in the second look `flipped limb` or `neighbor`; `held` for a
    frame that shows nothing new and is not solved."""
    groups: int
    """Rigid groups at the end of the frame."""
    seconds: dict[str, float]
    """Wall time a stage [s]."""

    def with_time(self, seconds: Mapping[str, float]) -> "FrameStats":
        """Return the same with more wall time [s], by stage; a stage may come again."""
        total = dict(self.seconds)
        for stage, more in seconds.items():
            total[stage] = total.get(stage, 0.0) + more
        return dataclasses.replace(self, seconds=total)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SolvedFrame:
    """One frame of the clip, solved."""

    poses: AnchorPoses
    """Where the anchors are."""
    camera: Camera
    """Where the camera is."""
    groups: RigidGroups
    """The rigid parts known by then."""
    stats: FrameStats
    """How it went."""
    uncertainty: AnchorUncertainty | None = None
    """How well the frame shows where the anchors are; None if it was not estimated."""

    def solved_again(self, poses: AnchorPoses, seconds: Mapping[str, float]) -> "SolvedFrame":
        """Return the frame with another pose, and the wall time [s] that took, by stage, on top."""
        return dataclasses.replace(self, poses=poses, stats=self.stats.with_time(seconds))

    @property
    def is_held(self) -> bool:
        """Whether it shows nothing new, and so has the pose of the frame before it."""
        return self.stats.start == "held"

    @property
    def was_solved(self) -> bool:
        """Whether its pose is its own: neither the rest pose nor that of the frame before it."""
        return self.stats.start != "rest" and not self.is_held


def with_held_following(frames: Sequence[SolvedFrame]) -> list[SolvedFrame]:
    """Return the frames, those that are held with the pose that the one before them has by now."""
    following: list[SolvedFrame] = []
    for frame in frames:
        poses = following[-1].poses if frame.is_held else frame.poses
        following.append(dataclasses.replace(frame, poses=poses))
    return following
