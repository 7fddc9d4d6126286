"""Search for limbs that descent from the last pose has lost.

A descent finds what is near. After a large step a limb may be nearer to the place of another, or have turned too far;
what comes out from behind the body is nowhere near. So limbs are searched for in a frame that moved far and is
explained much worse than the one before it, and in one of which a piece is not explained at all: one limb after the
other is swung to the sides, all descend side by side on a smaller picture, and the worst drop out. After a large step
they start from the last pose solved with a stiff object first, which keeps limbs in order. The energy of the image
stage says which is kept.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
import torch

from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import Draw, ImageSolver
from animator.deform.limb_swings import SwingConfig, swung_poses
from animator.deform.limbs import Limb, find_limbs, line_of
from animator.deform.losses import SQUARES
from animator.match.unexplained import UNEXPLAINED, CoveredImage, Piece, largest_unexplained_piece
from animator.sequence.bare_solver import BareSolver
from animator.sequence.pose_change import step_length
from animator.sequence.sketch import Sketcher
from animator.sequence.solved_frame import SolvedFrame
from animator.sequence.stopwatch import Stopwatch
from animator.types import AnchorPoses, Anchors, Camera

SEARCH = "limb search"
"""What a frame's start and seconds call it."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Heat:
    """One part of a race."""

    steps: int
    """Steps that everyone descends for."""
    places: int
    """Candidates that go on."""
    places_per_limb: int
    """And of those with the same limb swung."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class LimbSearchConfig:
    """When limbs are searched for, and how long."""

    far: float = 0.03
    """Step from one frame to the next, of the fastest twentieth of the anchors, that is large [diagonals]."""
    worse: float = 1.6
    """Times the energy of the frame before, that its energy must be."""
    usual: float = 0.02
    """Energy of a well explained frame: where the one before has even less, this counts."""
    piece: float = 0.01
    """Largest unexplained piece that is left alone [share of the silhouette]."""
    thinnest: float = 0.03
    """Width below which a piece is thin, and does not count [share of the object's size in the image]."""
    within_reach: float = 1.25
    """How far from the base of a limb a piece may be for the limb to be searched for there [lengths of the limb]."""
    patience: int = 3
    """Frames after a search in vain in which a piece is left alone."""
    nearly: float = 0.25
    """Share by which the solution that was stiff at first may cost more than the frame's own to be gone on from."""
    most_swings: int = 3
    """Limbs that are swung, one after the other, as long as it helps; 0 switches the search off."""
    step_per_swing: float = 0.15
    """Step, as above, for which one limb is swung; for as much again another [diagonals]."""
    heats: tuple[Heat, ...] = (
        Heat(steps=8, places=12, places_per_limb=2),
        Heat(steps=16, places=6, places_per_limb=1),
        Heat(steps=32, places=2, places_per_limb=1),
    )
    """A race of candidates; those that win places in the last are solved in full."""
    back: float = 0.5
    """Share of its swing left, below which a limb has come back to where it was, and drops out."""
    gain: float = 0.03
    """Share of the energy that another solution must save, over the frame's own solved for as long."""
    swing_gain: float = 0.1
    """And that the first swing must save: what saves less is mostly a limb that leans the wrong way in depth."""
    next_gain: float = 0.01
    """And each swing after it."""
    swings: SwingConfig = dataclasses.field(default_factory=SwingConfig)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Runner:
    """One candidate of a race."""

    limb: Limb
    """What was swung."""
    poses: AnchorPoses
    """Where it is by now."""
    swing: float
    """How far the limb was swung [scene unit]."""


def is_far(
    last: SolvedFrame, frame: SolvedFrame, diagonal: float, config: LimbSearchConfig
) -> bool:
    """Tell whether a frame is a large step from the last one on an object of a diagonal [scene unit]."""
    return step_length(last.poses, frame.poses) > config.far * diagonal


def is_badly_explained(energy: float, last_energy: float, config: LimbSearchConfig) -> bool:
    """Tell whether a frame is explained far worse than the one before it."""
    return energy > config.worse * max(last_energy, config.usual)


def was_in_vain(frame: SolvedFrame) -> bool:
    """Tell whether limbs were searched for in a frame, and nothing better was found."""
    return SEARCH in frame.stats.seconds and frame.stats.start != SEARCH


def searched(frame: SolvedFrame, search: Callable[[], AnchorPoses | None]) -> SolvedFrame:
    """Search for the limbs of a frame; where nothing better is found only the time is noted.

    Args:
        frame: The frame, solved.
        search: Returns better poses, or None.
    """
    watch = Stopwatch()
    poses = search()
    watch.lap(SEARCH)
    frame = frame.solved_again(frame.poses if poses is None else poses, watch.seconds)
    if poses is None:
        return frame
    return dataclasses.replace(frame, stats=dataclasses.replace(frame.stats, start=SEARCH))


class LimbSearch:
    """Searches in the frames of one clip."""

    def __init__(
        self,
        image_solver: ImageSolver,
        anchors: Anchors,
        draw: Draw,
        sketcher: Sketcher,
        config: LimbSearchConfig,
    ) -> None:
        self._image_solver = image_solver
        self._solver = BareSolver(image_solver)
        self._anchors = anchors
        self._draw = draw
        self._sketcher = sketcher
        self._config = config
        stiff = dataclasses.replace(image_solver.config, arap_norm=SQUARES, turn_norm=SQUARES)
        self._stiff_solver = self._solver.with_config(stiff)
        self._limbs = find_limbs(anchors, (config.swings.length,))

    def missing_piece(self, target: FrameTarget, poses: AnchorPoses) -> Piece | None:
        """Return a piece of a frame that a pose leaves unexplained: a limb is not where it should be."""
        with torch.no_grad():
            rgb, alpha = self._draw(self._image_solver.pose(poses), target.camera)
        piece = largest_unexplained_piece(
            CoveredImage.of(rgb, alpha),
            CoveredImage.of(target.image.rgb, target.image.alpha),
            error=UNEXPLAINED,
            thinnest_px=self._config.thinnest * target.object_px,
        )
        return piece if piece and piece.share > self._config.piece else None

    def after_large_step(
        self, target: FrameTarget, own: AnchorPoses, previous: AnchorPoses
    ) -> AnchorPoses | None:
        """Search for a better solution of a frame that moved far: any limb may be lost.

        Args:
            target: The frame, seen in the colors of the present view.
            own: Its solution so far.
            previous: The pose of the frame before it.

        Returns:
            The better one; None if none is clearly better.
        """
        config = self._config
        ordered = self._solver.solve(target, self._stiff_solver.solve(target, previous))
        nearly = (1.0 + config.nearly) * self._solver.energy(target, own)
        start = ordered if self._solver.energy(target, ordered) < nearly else own
        best = self._better(target, own, [ordered], config.gain)
        step = step_length(previous, own) / self._image_solver.gaussians.diagonal
        swings = min(math.ceil(step / config.step_per_swing), config.most_swings)
        return self._with_swings(target, self._limbs, swings, start=start, best=best, own=own)

    def for_piece(self, target: FrameTarget, own: AnchorPoses, piece: Piece) -> AnchorPoses | None:
        """Search for a better solution of a frame of which a piece is not explained, with what can reach it.

        Args:
            target: The frame, seen in the colors of the present view.
            own: Its solution so far.
            piece: The piece.

        Returns:
            The better one; None if none is clearly better.
        """
        limbs = [limb for limb in self._limbs if self._reaches(limb, own, target.camera, piece)]
        return self._with_swings(target, limbs, 1, start=own, best=own, own=own)

    def _reaches(self, limb: Limb, poses: AnchorPoses, camera: Camera, piece: Piece) -> bool:
        """Tell whether a limb can turn about its base so that it covers a piece."""
        line = line_of(limb, self._anchors, poses, camera)
        (base_px,), (depth,) = camera.project(line.base[None])
        tip_px = 2.0 * np.linalg.norm(line.direction) / depth * camera.intrinsics[0, 0]
        away_px = np.linalg.norm(piece.middle_px - base_px)
        return bool(away_px < self._config.within_reach * tip_px)

    def _with_swings(
        self,
        target: FrameTarget,
        limbs: Sequence[Limb],
        most_swings: int,
        *,
        start: AnchorPoses,
        best: AnchorPoses,
        own: AnchorPoses,
    ) -> AnchorPoses | None:
        """Swing limbs one after the other, as long as it helps."""
        config = self._config
        gain = config.swing_gain
        for _ in range(most_swings):
            better = self._better(target, best, self._swung(target, limbs, start), gain)
            if better is best:
                break
            start = best = better
            gain = config.next_gain
        return best if self._solver.is_clearly_better(target, best, own, config.gain) else None

    def _swung(
        self, target: FrameTarget, limbs: Sequence[Limb], poses: AnchorPoses
    ) -> list[AnchorPoses]:
        """Swing limbs of a pose, and solve from the swings that promise most."""
        sketch = self._sketcher.sketch(target)
        runners = [
            _Runner(limb=limb, poses=swung, swing=_distance(limb, swung, poses))
            for limb in limbs
            for swung in swung_poses(self._anchors, poses, target.camera, limb, self._config.swings)
        ]
        for heat in self._config.heats:
            poses = sketch.solve(poses, heat.steps)
            runners = [
                dataclasses.replace(runner, poses=sketch.solve(runner.poses, heat.steps))
                for runner in runners
            ]
            runners.sort(key=lambda runner: sketch.energy(runner.poses))
            runners = self._placed(runners, poses, heat)
        return [self._solver.solve(target, runner.poses) for runner in runners]

    def _placed(self, runners: Sequence[_Runner], poses: AnchorPoses, heat: Heat) -> list[_Runner]:
        """Return those that go on, of candidates in the order of their energies."""
        placed: list[_Runner] = []
        for runner in runners:
            is_back = _distance(runner.limb, runner.poses, poses) < self._config.back * runner.swing
            of_limb = sum(runner.limb is other.limb for other in placed)
            if not is_back and of_limb < heat.places_per_limb:
                placed.append(runner)
        return placed[: heat.places]

    def _better(
        self, target: FrameTarget, poses: AnchorPoses, others: Sequence[AnchorPoses], gain: float
    ) -> AnchorPoses:
        """Return the one of the others with the least energy if it saves that share of it, else the pose itself."""
        costs = [self._solver.energy(target, other) for other in others]
        enough = (1.0 - gain) * self._solver.energy(target, poses)
        if not costs or min(costs) > enough:
            return poses
        return others[int(np.argmin(costs))]


def _distance(limb: Limb, one: AnchorPoses, other: AnchorPoses) -> float:
    """Measure how far apart a limb is in two poses [scene unit]."""
    moved = (one.translations - other.translations).norm(dim=1).detach().cpu().numpy()
    return float(np.average(moved, weights=limb.shares))
