"""Where the image stage of a frame begins: the candidate that explains the frame best.

Motion goes on or not, matches are excellent on texture and harmful where there is none, claims find what moved too
far for matches: what the frame shows tells which to believe, so each candidate is drawn and compared with it.
"""

import dataclasses

import numpy as np

from animator.deform.image_solver import FrameTarget, ImageSolver
from animator.sequence.claim_stage import ClaimStage
from animator.sequence.match_stage import FramePair, MatchStage
from animator.sequence.pose_change import extrapolated
from animator.sequence.stopwatch import Stopwatch
from animator.types import AnchorPoses, GaussianMatches


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Start:
    """Where the image stage begins, and what it is given."""

    poses: AnchorPoses
    """The candidate chosen."""
    name: str
    """Which: `previous`, `extrapolated`, `matches` or `claims`."""
    expected: AnchorPoses
    """The pose of the frame as far as the frames before it tell."""
    matches: GaussianMatches | None
    """Matches with the frame; None if there are none, or too few."""


class StartStage:
    """Chooses starts for the frames of one clip."""

    def __init__(
        self, image_solver: ImageSolver, match_stage: MatchStage, claim_stage: ClaimStage
    ) -> None:
        self._image_solver = image_solver
        self._match_stage = match_stage
        self._claim_stage = claim_stage

    def expect(
        self, target: FrameTarget, previous: AnchorPoses, before: AnchorPoses | None
    ) -> Start:
        """Expect motion to go on at constant velocity where that explains the frame, else to stop.

        Args:
            target: The frame.
            previous: The pose of the frame before it.
            before: The pose of the frame before that; None where there is none, or motion is not to be continued.
        """
        poses, name = previous, "previous"
        if before is not None:
            onward = extrapolated(before, previous)
            if self._is_better(onward, previous, target):
                poses, name = onward, "extrapolated"
        return Start(poses=poses, name=name, expected=poses, matches=None)

    def follow_matches(
        self,
        start: Start,
        pair: FramePair,
        target: FrameTarget,
        rng: np.random.Generator,
        watch: Stopwatch,
    ) -> Start:
        """Match the frame, and start from what its matches and then its claims ask for where that is better."""
        matched = self._match_stage.solve(pair, target, start.expected, rng, watch)
        if matched is None:
            return start
        poses, name = start.poses, start.name
        if self._is_better(matched.poses, poses, target):
            poses, name = matched.poses, "matches"
        watch.lap("choose start")
        claimed = self._claim_stage.solve(poses, matched, target, start.expected, rng)
        if claimed is not None:
            poses, name = claimed, "claims"
        watch.lap("claims")
        return dataclasses.replace(start, poses=poses, name=name, matches=matched.matches)

    def _is_better(self, one: AnchorPoses, other: AnchorPoses, target: FrameTarget) -> bool:
        """Tell whether the render of one pose explains the frame better than that of another."""
        error = self._image_solver.image_error
        return error(one, target) < error(other, target)
