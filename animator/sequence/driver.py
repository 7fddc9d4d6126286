"""The autoregressive driver: solves frame after frame, each starting from the last (paper Sec. 3.4).

The rig is persistent: anchors, neighbors and weights belong to the rest pose, and every frame is solved for
absolute transformations from rest, so nothing drifts by re-anchoring and one skeleton can carry the clip.
"""

import dataclasses
import logging
import time
from collections.abc import Iterator

import numpy as np
import torch

from animator.deform.gauss_newton import MatchProblem, MatchSolverConfig, solve_matches
from animator.deform.image_solver import (
    FrameTarget,
    ImageSolver,
    ImageSolverConfig,
    RigidPairs,
)
from animator.match.features import FeatureMatcher
from animator.match.lifting import lift_flow
from animator.match.protocol import MaskedImage, Matcher
from animator.pnp import solve_pnp
from animator.render.protocol import Renderer
from animator.rigid.growing import GrowingConfig, carry_groups, grow_groups
from animator.rigid.refinement import GroupRefiner, RefinementConfig
from animator.sequence.camera_pose import CameraTools, refine_camera
from animator.sequence.target import FrameView, Window, crop_window, masked_render
from animator.types import (
    AnchorPoses,
    Anchors,
    Camera,
    Frames,
    GaussianMatches,
    Gaussians,
    RigidGroups,
)

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DriverConfig:
    """What happens in each frame."""

    use_matches: bool = True
    """Match and solve the deformation term (off: `--no-deform`)."""
    use_growing: bool = True
    """Start rigid groups by PnP region growing (off: `--no-region-growing`)."""
    use_refinement: bool = True
    """Refine rigid groups inside the optimization (off: `--no-refinement`)."""
    match_rounds: int = 2
    """Rounds of render, match, solve before the image stage."""
    previous_match_weight: float = 0.3
    """Weight of previous-frame matches beside those of the render."""
    max_matches: int = 3000
    """Matches kept a set."""
    min_matches: int = 30
    """Fewer matches than this are not solved for."""
    grow_after: float = 0.05
    """Matched motion from rest [object sizes] below which everything looks rigid and no group is grown."""
    refine_steps: tuple[float, ...] = (0.4, 0.6, 0.8)
    """When groups are refined [share of the image stage]."""
    rigid_pairs: int = 4096
    """Pairs of Gaussians that Eq. 4 is averaged over."""
    pnp_threshold: float = 0.01
    """PnP-RANSAC reprojection threshold [object sizes]."""
    match_solver: MatchSolverConfig = dataclasses.field(default_factory=MatchSolverConfig)
    image_solver: ImageSolverConfig = dataclasses.field(default_factory=ImageSolverConfig)
    growing: GrowingConfig = dataclasses.field(default_factory=GrowingConfig)
    refinement: RefinementConfig = dataclasses.field(default_factory=RefinementConfig)


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameStats:
    """What the report says of one frame."""

    matches: int
    """Gaussian-to-pixel matches used."""
    reprojection_px: float
    """Median distance of matched Gaussians to their pixels after solving [px]; NaN without matches."""
    start: str
    """Which candidate started the image stage."""
    groups: int
    """Rigid groups at the end of the frame."""
    seconds: dict[str, float]
    """Wall time a stage [s]."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SolvedFrame:
    """One frame of the clip, solved."""

    poses: AnchorPoses
    camera: Camera
    groups: RigidGroups
    stats: FrameStats


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ClipProblem:
    """Everything the driver works on."""

    gaussians: Gaussians
    anchors: Anchors
    frames: Frames
    cameras: tuple[Camera, ...]
    """One camera a frame."""
    renderer: Renderer
    matcher: Matcher
    seed: int
    follow_camera: bool = False
    """Re-estimate the camera of every frame from the previous one: it moves, and no file says how."""


class _Stopwatch:
    """Adds up wall time by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now


class Driver:
    """Solves the frames of one clip in order."""

    def __init__(self, problem: ClipProblem, config: DriverConfig) -> None:
        self._problem = problem
        self._config = config
        self._diagonal = problem.gaussians.diagonal
        self._rest_means = problem.gaussians.means.detach().cpu().numpy().astype(np.float64)
        self._solver = ImageSolver(
            problem.gaussians, problem.anchors, self._draw, config.image_solver
        )
        self._refiner = GroupRefiner(
            problem.gaussians,
            self._diagonal,
            config.refinement,
            np.random.default_rng(problem.seed),
        )
        self._views = [
            FrameView.read(problem.frames, index) for index in range(len(problem.frames))
        ]

    def first(self) -> SolvedFrame:
        """Return the rest pose as the pose of frame 0: where every clip starts."""
        stats = FrameStats(
            matches=0, reprojection_px=float("nan"), start="rest", groups=0, seconds={}
        )
        return SolvedFrame(
            poses=AnchorPoses.identity(self._problem.anchors),
            camera=self._problem.cameras[0],
            groups=RigidGroups(labels=np.full(len(self._problem.gaussians), -1, np.int64)),
            stats=stats,
        )

    def run(self, solved: list[SolvedFrame]) -> Iterator[SolvedFrame]:
        """Solve the frames after those already solved, one at a time.

        Args:
            solved: Frames 0..k-1, at least frame 0; extended in place.

        Yields:
            Each newly solved frame.
        """
        for index in range(len(solved), len(self._views)):
            solved.append(self.solve(index, solved[-1]))
            yield solved[-1]

    def solve(self, index: int, previous: SolvedFrame) -> SolvedFrame:
        """Solve one frame from the previous one."""
        watch = _Stopwatch()
        # One generator a frame, so that a resumed run draws the same numbers as an unbroken one.
        rng = np.random.default_rng((self._problem.seed, index))
        view = self._views[index]
        previous_gaussians = self._solver.pose(previous.poses)
        camera = self._camera(index, previous, previous_gaussians)
        window = crop_window(view, self._draw(previous_gaussians, camera)[1], camera)
        target = view.target(window, camera)
        watch.lap("render")

        candidates = {"previous": (previous.poses, None)}
        if self._config.use_matches:
            candidates |= self._matched_candidates(index, previous, window, target, rng, watch)
        errors = {
            name: self._solver.image_error(poses, target) for name, (poses, _) in candidates.items()
        }
        best = min(errors, key=lambda name: errors[name])
        start, matches = candidates[best]
        matches = matches or next((m for _, m in candidates.values() if m is not None), None)
        watch.lap("choose")

        groups = previous.groups
        if matches is not None:
            groups = self._update_groups(groups, matches, target, rng)
        watch.lap("grow groups")
        probe_labels = self._refiner.adopt(groups)
        pair_source = _PairSource(self._refiner, self._config, probe_labels, rng)
        poses = self._solver.solve(
            dataclasses.replace(target, matches=matches),
            start,
            previous.poses,
            rigid_pairs=pair_source,
        )
        groups = self._refiner.spread(pair_source.probe_labels)
        watch.lap("image stage")
        stats = FrameStats(
            matches=0 if matches is None else len(matches),
            reprojection_px=self._reprojection(poses, matches, target),
            start=best,
            groups=groups.count,
            seconds=watch.seconds,
        )
        return SolvedFrame(poses=poses, camera=camera, groups=groups, stats=stats)

    def _camera(self, index: int, previous: SolvedFrame, posed: Gaussians) -> Camera:
        """Return the frame's camera, followed from the previous frame's if it moves."""
        if not self._problem.follow_camera:
            return self._problem.cameras[index]
        tools = CameraTools(
            renderer=self._problem.renderer,
            features=FeatureMatcher(),
            matcher=self._problem.matcher,
        )
        frame = self._views[index].masked()
        return refine_camera(posed, previous.camera, frame, tools).camera

    def _draw(self, gaussians: Gaussians, camera: Camera) -> tuple[torch.Tensor, torch.Tensor]:
        rendering = self._problem.renderer.render(gaussians, camera)
        return rendering.rgb, rendering.alpha

    def _matched_candidates(
        self,
        index: int,
        previous: SolvedFrame,
        window: Window,
        target: FrameTarget,
        rng: np.random.Generator,
        watch: _Stopwatch,
    ) -> dict[str, tuple[AnchorPoses, GaussianMatches | None]]:
        """Solve from the matches of the previous frame, then from those of the render.

        Returns:
            Named candidate poses with the matches that go with them.
        """
        frame = self._views[index].masked(window)
        earlier = self._views[index - 1].masked(window)
        earlier_camera = window.of(previous.camera)
        from_previous = self._lift(previous.poses, earlier_camera, earlier, frame, rng)
        watch.lap("match")
        if len(from_previous) < self._config.min_matches:
            return {}
        poses = self._solve_matches(target, ((from_previous, 1.0),), previous.poses, previous.poses)
        watch.lap("match solver")
        latest = from_previous
        for _ in range(self._config.match_rounds):
            render = masked_render(*self._draw(self._solver.pose(poses), target.camera))
            latest = self._lift(poses, target.camera, render, frame, rng)
            watch.lap("match")
            if len(latest) < self._config.min_matches:
                return {"matches": (poses, from_previous)}
            terms = ((latest, 1.0), (from_previous, self._config.previous_match_weight))
            poses = self._solve_matches(target, terms, poses, previous.poses)
            watch.lap("match solver")
        return {"matches": (poses, latest)}

    def _lift(
        self,
        poses: AnchorPoses,
        camera: Camera,
        source: MaskedImage,
        frame: MaskedImage,
        rng: np.random.Generator,
    ) -> GaussianMatches:
        """Match an image of the given pose to the frame and carry the matches to the Gaussians."""
        visibility = self._problem.renderer.visibility(self._solver.pose(poses), camera)
        flow = self._problem.matcher.flow(source, frame)
        return lift_flow(
            flow,
            visibility.centres_px,
            visibility.visible_shares,
            max_count=self._config.max_matches,
            rng=rng,
        )

    def _solve_matches(
        self,
        target: FrameTarget,
        terms: tuple[tuple[GaussianMatches, float], ...],
        start: AnchorPoses,
        previous: AnchorPoses,
    ) -> AnchorPoses:
        problem = MatchProblem(
            anchors=self._problem.anchors,
            rest_means=self._rest_means,
            camera=target.camera,
            terms=terms,
            diagonal=self._diagonal,
            object_px=target.object_px,
        )
        return solve_matches(problem, start, previous, self._config.match_solver)

    def _update_groups(
        self,
        groups: RigidGroups,
        matches: GaussianMatches,
        target: FrameTarget,
        rng: np.random.Generator,
    ) -> RigidGroups:
        """Carry the groups over and grow new ones from this frame's matches."""

        def find_inliers(points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
            return solve_pnp(
                points,
                pixels,
                target.camera,
                threshold_px=self._config.pnp_threshold * target.object_px,
            ).inliers

        arguments = (matches, self._rest_means)
        groups = carry_groups(groups, *arguments, find_inliers, self._config.growing)
        rest_px, _ = target.camera.project(self._rest_means[matches.gaussian_ids])
        moved_px = np.median(np.linalg.norm(rest_px - matches.target_px, axis=1))
        if self._config.use_growing and moved_px > self._config.grow_after * target.object_px:
            groups = grow_groups(
                groups, *arguments, self._diagonal, find_inliers, self._config.growing, rng
            )
        return groups

    def _reprojection(
        self, poses: AnchorPoses, matches: GaussianMatches | None, target: FrameTarget
    ) -> float:
        if matches is None or len(matches) == 0:
            return float("nan")
        means = self._solver.pose(poses).means.detach().cpu().numpy()
        projected, _ = target.camera.project(means[matches.gaussian_ids])
        return float(np.median(np.linalg.norm(projected - matches.target_px, axis=1)))


class _PairSource:
    """Supplies the pairs of Eq. 4 to the image stage and refines the groups on the way."""

    def __init__(
        self,
        refiner: GroupRefiner,
        config: DriverConfig,
        probe_labels: np.ndarray,
        rng: np.random.Generator,
    ) -> None:
        self._refiner = refiner
        self._config = config
        self._rng = rng
        steps = config.image_solver.iterations
        self._refine_at = {int(share * steps) for share in config.refine_steps}
        self.probe_labels = probe_labels
        self._pairs = self._sample()

    def __call__(self, step: int, posed: Gaussians) -> RigidPairs | None:
        if self._config.use_refinement and step in self._refine_at:
            self.probe_labels = self._refiner.refine(
                self.probe_labels,
                posed.posed(posed.means.detach(), posed.quats_wxyz.detach()),
                self._rng,
            )
            self._pairs = self._sample()
        return self._pairs

    def _sample(self) -> RigidPairs | None:
        first, second = self._refiner.sample_pairs(
            self.probe_labels, self._config.rigid_pairs, self._rng
        )
        if len(first) == 0:
            return None
        return RigidPairs(first=torch.from_numpy(first), second=torch.from_numpy(second))
