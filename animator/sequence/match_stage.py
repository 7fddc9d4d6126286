"""Matches of one frame: from the last frame and from the render, lifted to Gaussians and solved for."""

import dataclasses

import numpy as np

from animator.deform.frame_target import FrameTarget
from animator.deform.gauss_newton import MatchProblem, MatchSolverConfig, solve_matches
from animator.deform.image_solver import Draw, ImageSolver
from animator.deform.uncertainty import estimate_uncertainty
from animator.match.lifting import lift_flow
from animator.match.protocol import MaskedImage, Matcher
from animator.render.protocol import Renderer
from animator.sequence.stopwatch import Stopwatch
from animator.sequence.target import masked_render
from animator.types import AnchorPoses, Anchors, AnchorUncertainty, Camera, GaussianMatches


@dataclasses.dataclass(frozen=True, kw_only=True)
class MatchStageConfig:
    """How a frame is matched."""

    rounds: int = 2
    """Rounds of render, match, solve."""
    previous_weight: float = 0.3
    """Weight of previous-frame matches beside those of the render."""
    max_matches: int = 3000
    """Matches kept a set."""
    min_matches: int = 30
    """Fewer matches than this are not solved for."""
    solver: MatchSolverConfig = dataclasses.field(default_factory=MatchSolverConfig)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FramePair:
    """The frame to solve and the image it is matched from, in one window."""

    earlier: MaskedImage
    """The previous frame, or the render of the rest pose for frame 0."""
    earlier_camera: Camera
    """The camera of `earlier`."""
    earlier_poses: AnchorPoses
    """The pose that `earlier` shows."""
    frame: MaskedImage
    """The frame to solve."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class MatchedPose:
    """A pose that the matches ask for."""

    poses: AnchorPoses
    """The pose."""
    matches: GaussianMatches
    """The last matches it was solved from."""


class MatchStage:
    """Matches and solves frame after frame for one clip."""

    def __init__(
        self,
        anchors: Anchors,
        image_solver: ImageSolver,
        renderer: Renderer,
        draw: Draw,
        matcher: Matcher,
        config: MatchStageConfig,
    ) -> None:
        self._anchors = anchors
        self._image_solver = image_solver
        self._renderer = renderer
        self._draw = draw
        self._matcher = matcher
        self._config = config
        rest = image_solver.gaussians
        self._diagonal = rest.diagonal
        self._rest_means = rest.means.detach().cpu().numpy().astype(np.float64)

    def solve(
        self,
        pair: FramePair,
        target: FrameTarget,
        expected: AnchorPoses,
        rng: np.random.Generator,
        watch: Stopwatch,
    ) -> MatchedPose | None:
        """Solve from the matches of the earlier image, then from those of the render, held to the expected pose.

        Returns:
            The pose with its matches; None where too few matches were found.
        """
        config = self._config
        first = self.find(pair, rng)
        watch.lap("match")
        if first is None:
            return None
        poses = self.solve_terms(target, ((first, 1.0),), expected, expected)
        watch.lap("match solver")
        latest = first
        for _ in range(config.rounds):
            found = self.find_from_render(poses, target.camera, pair.frame, rng)
            watch.lap("match")
            if found is None:
                break
            latest = found
            terms = ((latest, 1.0), (first, config.previous_weight))
            poses = self.solve_terms(target, terms, poses, expected)
            watch.lap("match solver")
        return MatchedPose(poses=poses, matches=latest)

    def reprojection_px(
        self, poses: AnchorPoses, matches: GaussianMatches, camera: Camera
    ) -> float:
        """Measure the median distance of matched Gaussians to their pixels [px]."""
        means = self._image_solver.pose(poses).means.detach().cpu().numpy()
        projected, _ = camera.project(means[matches.gaussian_ids])
        return float(np.median(np.linalg.norm(projected - matches.target_px, axis=1)))

    def find(self, pair: FramePair, rng: np.random.Generator) -> GaussianMatches | None:
        """Match the earlier image; None where too few are found."""
        return self._lift(pair.earlier_poses, pair.earlier_camera, pair.earlier, pair.frame, rng)

    def find_from_render(
        self, poses: AnchorPoses, camera: Camera, frame: MaskedImage, rng: np.random.Generator
    ) -> GaussianMatches | None:
        """Match the render of a pose with the frame; None where too few are found."""
        render = masked_render(*self._draw(self._image_solver.pose(poses), camera))
        return self._lift(poses, camera, render, frame, rng)

    def uncertainty(
        self, poses: AnchorPoses, matches: GaussianMatches | None, target: FrameTarget
    ) -> AnchorUncertainty:
        """Estimate how well the matches of a frame determine its final pose."""
        residual_px = 0.0
        if matches is not None:
            # The length of a normal error in the plane has its median at 1.18 standard deviations.
            median_px = self.reprojection_px(poses, matches, target.camera)
            residual_px = median_px / np.sqrt(2.0 * np.log(2.0))
        terms = () if matches is None else ((matches, 1.0),)
        return estimate_uncertainty(
            self._problem(target, terms), poses, self._config.solver, residual_px=residual_px
        )

    def _lift(
        self,
        poses: AnchorPoses,
        camera: Camera,
        source: MaskedImage,
        frame: MaskedImage,
        rng: np.random.Generator,
    ) -> GaussianMatches | None:
        """Match an image of the given pose to the frame and carry the matches to the Gaussians, if there are enough."""
        seen = self._renderer.visibility(self._image_solver.pose(poses), camera)
        found = lift_flow(
            self._matcher.flow(source, frame),
            seen.centres_px,
            seen.visible_shares,
            max_count=self._config.max_matches,
            rng=rng,
        )
        return found if len(found) >= self._config.min_matches else None

    def solve_terms(
        self,
        target: FrameTarget,
        terms: tuple[tuple[GaussianMatches, float], ...],
        start: AnchorPoses,
        previous: AnchorPoses,
    ) -> AnchorPoses:
        """Solve for weighted sets of matches from `start`, held to the previous or expected pose."""
        return solve_matches(self._problem(target, terms), start, previous, self._config.solver)

    def _problem(
        self, target: FrameTarget, terms: tuple[tuple[GaussianMatches, float], ...]
    ) -> MatchProblem:
        return MatchProblem(
            anchors=self._anchors,
            rest_means=self._rest_means,
            camera=target.camera,
            terms=terms,
            diagonal=self._diagonal,
            object_px=target.object_px,
        )
