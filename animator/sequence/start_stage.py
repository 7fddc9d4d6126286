"""Where the image stage of a frame begins: the candidate that explains the frame best.

Motion goes on or not, matches are excellent on texture and harmful where there is none, claims find what moved too
far for matches: what the frame shows tells which to believe, so each candidate is drawn and compared with it. Where
limbs that look alike pass each other, a start may look better and lead to the wrong limb: so the motion that goes on
races the one chosen for a few steps.
"""

import dataclasses

import numpy as np

from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import ImageSolver
from animator.sequence.claim_stage import ClaimStage
from animator.sequence.match_stage import FramePair, MatchStage
from animator.sequence.pose_change import extrapolated, step_length
from animator.sequence.sketch import Sketcher
from animator.sequence.stopwatch import Stopwatch
from animator.types import AnchorPoses, GaussianMatches


@dataclasses.dataclass(frozen=True, kw_only=True)
class StartStageConfig:
    """How starts are compared."""

    race_steps: int = 24
    """Steps of the race; 0 switches it off."""
    race_apart: float = 0.03
    """Distance of the starts, of the twentieth of the anchors that is farthest apart, from which they race [diagonals]:
    what is nearer leads to the same place."""
    race_gain: float = 0.05
    """Share of the energy by which the motion that goes on must win."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Start:
    """Where the image stage begins, and what it is given."""

    poses: AnchorPoses
    """The candidate chosen."""
    name: str
    """Which: `previous`, `extrapolated`, `matches` or `claims`."""
    expected: AnchorPoses
    """The pose of the frame as far as the frames before it tell."""
    onward: AnchorPoses | None
    """The pose of the frame if motion goes on at constant velocity; None where that is not to be expected."""
    matches: GaussianMatches | None
    """Matches with the frame; None if there are none, or too few."""


class StartStage:
    """Chooses starts for the frames of one clip."""

    def __init__(
        self,
        image_solver: ImageSolver,
        match_stage: MatchStage,
        claim_stage: ClaimStage,
        sketcher: Sketcher,
        config: StartStageConfig,
    ) -> None:
        self._image_solver = image_solver
        self._match_stage = match_stage
        self._claim_stage = claim_stage
        self._sketcher = sketcher
        self._config = config

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
        onward = None if before is None else extrapolated(before, previous)
        if onward is not None and self._is_better(onward, previous, target):
            poses, name = onward, "extrapolated"
        return Start(poses=poses, name=name, expected=poses, onward=onward, matches=None)

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
        start = dataclasses.replace(start, poses=poses, name=name, matches=matched.matches)
        start = self._raced(start, target)
        watch.lap("choose start")
        return start

    def _raced(self, start: Start, target: FrameTarget) -> Start:
        """Let the motion that goes on race the start chosen, and start there if it wins clearly."""
        steps, onward = self._config.race_steps, start.onward
        if onward is None or start.name == "extrapolated" or steps == 0:
            return start
        diagonal = self._image_solver.gaussians.diagonal
        if step_length(start.poses, onward) < self._config.race_apart * diagonal:
            return start
        sketch = self._sketcher.sketch(target)
        enough = (1.0 - self._config.race_gain) * sketch.energy(sketch.solve(start.poses, steps))
        if sketch.energy(sketch.solve(onward, steps)) >= enough:
            return start
        return dataclasses.replace(start, poses=onward, name="extrapolated")

    def _is_better(self, one: AnchorPoses, other: AnchorPoses, target: FrameTarget) -> bool:
        """Tell whether the render of one pose explains the frame better than that of another."""
        error = self._image_solver.image_error
        return error(one, target) < error(other, target)
