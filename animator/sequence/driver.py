"""The autoregressive driver: solves frame after frame, each starting from the last (paper Sec. 3.4).

The rig is persistent: anchors, neighbors and weights belong to the rest pose, and every frame is solved for
absolute transformations from rest, so nothing drifts by re-anchoring and one skeleton can carry the clip.
"""

import dataclasses
import logging
from collections.abc import Iterator

import numpy as np

from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import ImageSolver, ImageSolverConfig
from animator.deform.rigid_solver import RigidSolverConfig, solve_rigid
from animator.sequence.bare_solver import BareSolver
from animator.sequence.cameras import followed_camera
from animator.sequence.claim_stage import ClaimStage, ClaimStageConfig
from animator.sequence.clip_problem import ClipProblem
from animator.sequence.depth_stage import DepthStage, DepthStageConfig
from animator.sequence.light_stage import LightStage, LightStageConfig
from animator.sequence.limb_search import (
    LimbSearch,
    LimbSearchConfig,
    is_badly_explained,
    is_far,
    searched,
    was_in_vain,
)
from animator.sequence.match_stage import FramePair, MatchStage, MatchStageConfig
from animator.sequence.rigid_stage import RigidStage, RigidStageConfig
from animator.sequence.sight import Sight
from animator.sequence.sketch import Sketcher
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.sequence.start_stage import StartStage, StartStageConfig
from animator.sequence.stillness import shows_the_same
from animator.sequence.stopwatch import Stopwatch
from animator.sequence.target import Window, silhouette_iou
from animator.types import AnchorPoses, Anchors, AnchorUncertainty, Camera, RigidGroups

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DriverConfig:
    """What happens in each frame."""

    use_matches: bool = True
    """Match, and solve the deformation term (off: `--no-deform`)."""
    continue_motion: bool = True
    """Expect motion to go on at constant velocity, where the frame agrees."""
    rest_overlap: float = 0.85
    """Silhouette IoU of the rest pose with frame 0 below which frame 0 is solved like the others."""
    matching: MatchStageConfig = dataclasses.field(default_factory=MatchStageConfig)
    claims: ClaimStageConfig = dataclasses.field(default_factory=ClaimStageConfig)
    start: StartStageConfig = dataclasses.field(default_factory=StartStageConfig)
    depth: DepthStageConfig = dataclasses.field(default_factory=DepthStageConfig)
    light: LightStageConfig = dataclasses.field(default_factory=LightStageConfig)
    rigid: RigidStageConfig = dataclasses.field(default_factory=RigidStageConfig)
    image_solver: ImageSolverConfig = dataclasses.field(default_factory=ImageSolverConfig)
    limb_search: LimbSearchConfig = dataclasses.field(default_factory=LimbSearchConfig)
    rigid_solver: RigidSolverConfig = dataclasses.field(default_factory=RigidSolverConfig)


class Driver:
    """Solves the frames of one clip in order."""

    def __init__(self, problem: ClipProblem, config: DriverConfig) -> None:
        self.problem = problem
        self._config = config
        self._sight = sight = Sight(problem)
        self._image_solver = ImageSolver(
            problem.gaussians, problem.anchors, sight.draw, config.image_solver
        )
        self.bare_solver = BareSolver(self._image_solver)
        self._match_stage = MatchStage(
            problem.anchors,
            self._image_solver,
            problem.renderer,
            sight.draw,
            problem.matcher,
            config.matching,
        )
        claim_stage = ClaimStage(
            self._image_solver,
            self._match_stage,
            problem.renderer,
            sight.draw,
            sight.colors,
            config.claims,
        )
        sketcher = Sketcher(self._image_solver, problem.anchors, problem.renderer, sight.colors)
        self._start_stage = StartStage(
            self._image_solver, self._match_stage, claim_stage, sketcher, config.start
        )
        self._depth_stage = DepthStage(
            problem.frames.depths, self._image_solver, problem.renderer, config.depth
        )
        self.light_stage = LightStage(self._image_solver, problem.renderer, sight, config.light)
        self._rigid_stage = RigidStage(problem.gaussians, config.rigid, problem.seed)
        self._limb_search = LimbSearch(
            self._image_solver, problem.anchors, sight.draw, sketcher, config.limb_search
        )

    def with_anchors(self, anchors: Anchors, first: SolvedFrame) -> "Driver":
        """Return a driver of the same clip with other anchors, or another skin on them.

        Args:
            anchors: The anchors.
            first: Frame 0, solved; the user's depth maps are measured by it.
        """
        driver = Driver(dataclasses.replace(self.problem, anchors=anchors), self._config)
        driver._depth_stage.calibrate(first.poses, first.camera)
        return driver

    def first(self) -> SolvedFrame:
        """Return frame 0: the rest pose where it explains the frame, else solved from there."""
        rest = SolvedFrame(
            poses=AnchorPoses.identity(self.problem.anchors),
            camera=self.problem.cameras[0],
            groups=RigidGroups(labels=np.full(len(self.problem.gaussians), -1, np.int64)),
            stats=FrameStats(
                matches=0, reprojection_px=float("nan"), start="rest", groups=0, seconds={}
            ),
        )
        _, alpha = self._sight.draw(self.problem.gaussians, rest.camera)
        overlap = silhouette_iou(alpha.cpu().numpy() > 0.5, self._sight.views[0].alpha > 127)
        if overlap >= self._config.rest_overlap:
            return dataclasses.replace(rest, uncertainty=self._rest_uncertainty(rest))
        logger.warning(
            "frame %s does not show the rest pose (silhouettes overlap by %.2f): it is solved too; "
            "if the object should be at rest there, check the camera and the masks",
            self.problem.frames.names[0],
            overlap,
        )
        return self._moved(0, [rest])

    def run(self, solved: list[SolvedFrame]) -> Iterator[SolvedFrame]:
        """Solve the frames after those already solved, one at a time.

        Args:
            solved: Frames 0..k-1, at least frame 0; extended in place.

        Yields:
            Each newly solved frame.
        """
        self._depth_stage.calibrate(solved[0].poses, solved[0].camera)
        self.light_stage.learn_afresh(solved)
        for index in range(len(solved), len(self._sight.views)):
            solved.append(self._held(index, solved) or self._moved(index, solved))
            self.light_stage.learn(index, solved[-1])
            yield solved[-1]

    def _moved(self, index: int, earlier: list[SolvedFrame]) -> SolvedFrame:
        """Solve a frame from the ones before it, and search for its limbs where they may be lost."""
        frame = self.solve(index, earlier[-1], earlier[-2] if len(earlier) > 1 else None)
        config = self._config.limb_search
        if config.most_swings == 0:
            return frame
        last, search = earlier[-1], self._limb_search
        far = is_far(last, frame, self.problem.gaussians.diagonal, config)
        # The last frame first: a target is seen in the colors of the view that was looked at last.
        last_energy = 0.0
        if far and index:
            last_energy = self.bare_solver.energy(self.target_of(index - 1, last), last.poses)
        target = self.target_of(index, frame)
        if far and is_badly_explained(
            self.bare_solver.energy(target, frame.poses), last_energy, config
        ):
            return searched(frame, lambda: search.after_large_step(target, frame.poses, last.poses))
        lately = earlier[max(len(earlier) - config.patience, 0) :]
        if any(map(was_in_vain, lately)):
            return frame
        piece = search.missing_piece(target, frame.poses)
        if piece is None:
            return frame
        return searched(frame, lambda: search.for_piece(target, frame.poses, piece))

    def _held(self, index: int, solved: list[SolvedFrame]) -> SolvedFrame | None:
        """Return the last result again if this frame shows what the frame it comes from showed."""
        source = max(k for k, frame in enumerate(solved) if not frame.is_held)
        cameras = self.problem.cameras
        if not np.array_equal(cameras[index].cam_from_world, cameras[source].cam_from_world):
            return None
        if not shows_the_same(self._sight.views[index], self._sight.views[source]):
            return None
        stats = dataclasses.replace(solved[-1].stats, start="held", seconds={})
        return dataclasses.replace(solved[-1], stats=stats)

    def solve(
        self, index: int, previous: SolvedFrame, before: SolvedFrame | None = None
    ) -> SolvedFrame:
        """Solve one frame from the previous one: match, choose a start, find groups, fit the image.

        Args:
            index: Which frame.
            previous: The frame before it.
            before: The frame before that; with it the motion may be expected to go on.

        Returns:
            The solved frame.
        """
        watch = Stopwatch()
        # One generator a frame, so that a resumed run draws the same numbers as an unbroken one.
        rng = np.random.default_rng((self.problem.seed, index))
        camera = self._camera(index, previous)
        window, target = self._look(index, previous.poses, camera)
        onward_from = before.poses if before and self._config.continue_motion else None
        start = self._start_stage.expect(target, previous.poses, onward_from)
        watch.lap("render")
        if self._config.use_matches:
            pair = self._pair(index, previous, window)
            start = self._start_stage.follow_matches(start, pair, target, rng, watch)
        matches = start.matches

        groups = self._rigid_stage.begin(previous.groups, matches, target, rng)
        watch.lap("rigid groups")
        depths = self._depth_stage.find(index, start.poses, target.camera, window)
        poses = self._image_solver.solve(
            dataclasses.replace(target, matches=matches, depths=depths),
            start.poses,
            start.expected,
            rigid_pairs=groups,
        )
        watch.lap("image")
        reprojection_px = float("nan")
        if matches is not None:
            reprojection_px = self._match_stage.reprojection_px(poses, matches, target.camera)
        uncertainty = self._match_stage.uncertainty(poses, matches, target)
        watch.lap("uncertainty")
        final_groups = groups.groups
        stats = FrameStats(
            matches=0 if matches is None else len(matches),
            reprojection_px=reprojection_px,
            start=start.name,
            groups=final_groups.count,
            seconds=watch.seconds,
        )
        return SolvedFrame(
            poses=poses, camera=camera, groups=final_groups, stats=stats, uncertainty=uncertainty
        )

    def refit_rigid(self, index: int, frame: SolvedFrame) -> AnchorPoses:
        """Fit a frame again by moving its pose, which is rigid already, as one body."""
        return solve_rigid(
            self._image_solver,
            self.problem.anchors,
            self.matched_target_of(index, frame),
            frame.poses,
            self._config.rigid_solver,
        )

    def image_loss(self, index: int, frame: SolvedFrame) -> float:
        """Measure how badly a solved pose explains its frame."""
        return self.bare_solver.image_loss(self.target_of(index, frame), frame.poses)

    def seen_shares(self, frame: SolvedFrame) -> np.ndarray:
        """Measure how much of what each anchor carries the camera sees, 0 to 1, shape (A,)."""
        posed = self._image_solver.pose(frame.poses)
        return self.problem.anchors.mean_of_carried(
            self.problem.renderer.visibility(posed, frame.camera).visible_shares
        )

    def target_of(self, index: int, frame: SolvedFrame) -> FrameTarget:
        """Return what a solved frame shows, cropped to where its pose and the object are."""
        return self._look_again(index, frame)[1]

    def matched_target_of(self, index: int, frame: SolvedFrame) -> FrameTarget:
        """Return what a solved frame shows, matched anew from the render of its pose."""
        window, target = self._look_again(index, frame)
        if not self._config.use_matches:
            return target
        rng = np.random.default_rng((self.problem.seed, index))
        matches = self._match_stage.find_from_render(
            frame.poses, target.camera, self._sight.views[index].masked(window), rng
        )
        return dataclasses.replace(target, matches=matches)

    def _rest_uncertainty(self, rest: SolvedFrame) -> AnchorUncertainty:
        """Estimate how well frame 0 shows that it is at rest."""
        window, target = self._look(0, rest.poses, rest.camera)
        matches = None
        if self._config.use_matches:
            rng = np.random.default_rng((self.problem.seed, 0))
            matches = self._match_stage.find(self._pair(0, rest, window), rng)
        return self._match_stage.uncertainty(rest.poses, matches, target)

    def _look(self, index: int, poses: AnchorPoses, camera: Camera) -> tuple[Window, FrameTarget]:
        return self._sight.look(index, self._image_solver.pose(poses), camera)

    def _look_again(self, index: int, frame: SolvedFrame) -> tuple[Window, FrameTarget]:
        window, target = self._look(index, frame.poses, frame.camera)
        depths = self._depth_stage.find(index, frame.poses, target.camera, window)
        return window, dataclasses.replace(target, depths=depths)

    def _pair(self, index: int, previous: SolvedFrame, window: Window) -> FramePair:
        """Pair the frame with the one before it, frame 0 with the render of the rest pose."""
        earlier_camera = window.of(previous.camera)
        if index:
            earlier = self._sight.views[index - 1].masked(window)
        else:
            earlier = self._sight.render(self._image_solver.pose(previous.poses), earlier_camera)
        return FramePair(
            earlier=earlier,
            earlier_camera=earlier_camera,
            earlier_poses=previous.poses,
            frame=self._sight.views[index].masked(window),
        )

    def _camera(self, index: int, previous: SolvedFrame) -> Camera:
        """Return the frame's camera, followed from the previous frame's if it moves."""
        if not self.problem.follow_camera:
            return self.problem.cameras[index]
        posed = self._image_solver.pose(previous.poses)
        frame = self._sight.views[index].masked()
        return followed_camera(self.problem, posed, previous.camera, frame)
