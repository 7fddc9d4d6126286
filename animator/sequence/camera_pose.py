"""The camera of a frame that came without one: retrieve a capture view, solve, refine."""

import dataclasses
import logging
from collections.abc import Sequence

import numpy as np

from animator.errors import InputError
from animator.match.features import FeatureMatcher
from animator.match.lifting import lift_flow, lift_matches
from animator.match.protocol import MaskedImage, Matcher
from animator.match.view_retrieval import RankedView, rank_views
from animator.pnp import solve_pnp
from animator.render.protocol import Renderer
from animator.sequence.capture_views import (
    at_frame,
    resized,
    shrunk,
    spread_cameras,
    warn_of_other_aspect,
)
from animator.types import Camera, GaussianMatches, Gaussians

_log = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class CameraSearch:
    """How a camera is looked for."""

    max_view_count: int = 60
    """Capture views looked at; more are thinned to those farthest apart."""
    retrieval_side_px: int = 640
    """Longer side of the images used for retrieval."""
    refine_side_px: int = 1280
    """Longer side of the images used for refinement."""
    candidate_count: int = 3
    """Best-ranked views whose pose is solved."""
    max_refine_rounds: int = 4
    """Most rounds of render, match, solve after the first pose."""
    settled: float = 0.0003
    """The pose is settled when a round moves the object less [object sizes in the image]."""
    seed_threshold: float = 0.015
    """Reprojection error of an inlier keypoint [object sizes in the image]."""
    refine_threshold: float = 0.01
    """Reprojection error of an inlier of the dense flow [object sizes in the image]."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class CameraTools:
    """What the search works with."""

    renderer: Renderer
    """Draws the Gaussians."""
    features: FeatureMatcher
    """Ranks the views."""
    matcher: Matcher
    """Refines the pose; optical flow suffices, the render is close by then."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CameraReport:
    """How the camera was found and how well it fits."""

    view_name: str
    """Name of the capture view it started from."""
    cell_count: int
    """Cells of the frame that this view's matches cover; 0 where no view was retrieved."""
    match_counts: tuple[int, ...]
    """Correspondences of each solve, the first from keypoints, the others from dense flow."""
    inlier_counts: tuple[int, ...]
    """How many of those agree with the pose."""
    error_px: float
    """Median reprojection error of the last solve's inliers, at the frame's resolution [px]."""
    silhouette_iou: float
    """Overlap of the render's silhouette with the frame's, 0..1."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FoundCamera:
    """A camera and how it was found."""

    camera: Camera
    """The frame's camera."""
    report: CameraReport
    """How it was found."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Solve:
    camera: Camera
    match_count: int
    inlier_count: int
    error_px: float
    moved_px: float
    """How far the pose moved the matched points in the image, median [px]."""


def find_camera(
    gaussians: Gaussians,
    capture_cameras: Sequence[Camera],
    frame: MaskedImage,
    tools: CameraTools,
    *,
    intrinsics: np.ndarray | None = None,
    search: CameraSearch | None = None,
) -> FoundCamera:
    """Find the camera that took a frame of the object in its rest pose.

    The capture views are rendered and ranked by how much of the frame they match; from the best few
    the pose is solved by PnP, and the pose with most inliers is refined by dense flow.

    Args:
        gaussians: The object at rest.
        capture_cameras: Cameras of the capture; their lens is scaled to the frame.
        frame: The image whose camera is wanted.
        tools: Renderer and matchers.
        intrinsics: The frame's pinhole matrix [px], pixel centres at +0.5, shape (3, 3); if not
            given, that of the retrieved capture camera, scaled.
        search: Effort and thresholds.

    Returns:
        The camera, named after the capture view, with a report.

    Raises:
        InputError: If there is no capture camera, no object in the frame, or no view matches well
            enough.
    """
    search = search or CameraSearch()
    if not capture_cameras:
        raise InputError(
            "--frame-camera auto: expected the capture's cameras to start from, found none; "
            "give them with --cameras, or the frame's own camera with --frame-camera FILE"
        )
    if not frame.mask.any():
        raise InputError(
            "--frame-camera auto: the frame's mask is empty, expected the object in it; "
            "give masks with --masks, or images with alpha"
        )
    height, width = frame.mask.shape
    lenses = [
        at_frame(camera, width, height, intrinsics)
        for camera in spread_cameras(capture_cameras, search.max_view_count)
    ]
    warn_of_other_aspect(capture_cameras[0], width, height)
    small_frame = shrunk(frame, search.retrieval_side_px)
    small_lenses = [resized(camera, small_frame.mask.shape) for camera in lenses]
    renders = [render_masked(tools.renderer, gaussians, camera) for camera in small_lenses]
    ranking = rank_views(renders, small_frame, features=tools.features)

    threshold_px = search.seed_threshold * small_frame.object_size_px
    candidates = [
        (view, _solve_view(gaussians, view, small_lenses[view.index], tools, threshold_px))
        for view in ranking[: search.candidate_count]
    ]
    view, seed = max(candidates, key=lambda candidate: candidate[1].inlier_count)
    name = lenses[view.index].name or f"view {view.index}"
    if seed.inlier_count == 0:
        raise InputError(
            "--frame-camera auto: no capture view matches the frame well enough to solve its "
            f"camera; the best, {name}, shares {view.cell_count} cells, {seed.match_count} points "
            "with it. The frame must show the object in its rest pose; if it does, give its camera "
            "with --frame-camera FILE"
        )
    start = lenses[view.index].with_pose(seed.camera.cam_from_world)
    refined = refine_camera(gaussians, start, frame, tools, search=search)
    report = dataclasses.replace(
        refined.report,
        cell_count=view.cell_count,
        match_counts=(seed.match_count, *refined.report.match_counts),
        inlier_counts=(seed.inlier_count, *refined.report.inlier_counts),
    )
    _log.info(
        "camera from %s: %d cells, %d of %d matches within %.2f px, silhouette IoU %.3f",
        name,
        report.cell_count,
        report.inlier_counts[-1],
        report.match_counts[-1],
        report.error_px,
        report.silhouette_iou,
    )
    return FoundCamera(camera=refined.camera, report=report)


def refine_camera(
    gaussians: Gaussians,
    camera: Camera,
    frame: MaskedImage,
    tools: CameraTools,
    *,
    search: CameraSearch | None = None,
) -> FoundCamera:
    """Refine a camera that is nearly right: render, match densely, solve, again.

    Also follows a moving camera from frame to frame, if the Gaussians are posed as in the frame.

    Args:
        gaussians: The object as the frame shows it.
        camera: First guess, at the frame's size.
        frame: The image.
        tools: Renderer and matcher.
        search: Effort and thresholds.

    Returns:
        The refined camera; the guess itself, with a warning, where no pose has enough support.
    """
    search = search or CameraSearch()
    small_frame = shrunk(frame, search.refine_side_px)
    current = resized(camera, small_frame.mask.shape)
    threshold_px = search.refine_threshold * small_frame.object_size_px
    solves = []
    for _ in range(search.max_refine_rounds):
        render = render_masked(tools.renderer, gaussians, current)
        flow = tools.matcher.flow(render, small_frame)
        seen = tools.renderer.visibility(gaussians, current)
        lifted = lift_flow(flow, seen.centres_px, seen.visible_shares)
        solve = _solve(gaussians, lifted, current, threshold_px)
        solves.append(solve)
        if solve.inlier_count == 0:
            _log.warning(
                "camera %s: refinement stopped, %d matches agree on no pose",
                camera.name,
                solve.match_count,
            )
            break
        current = solve.camera
        if solve.moved_px < search.settled * small_frame.object_size_px:
            break
    silhouette = render_masked(tools.renderer, gaussians, current).mask
    enlargement = camera.width_px / current.width_px
    report = CameraReport(
        view_name=camera.name,
        cell_count=0,
        match_counts=tuple(solve.match_count for solve in solves),
        inlier_counts=tuple(solve.inlier_count for solve in solves),
        error_px=solves[-1].error_px * enlargement if solves else float("nan"),
        silhouette_iou=_overlap(silhouette, small_frame.mask),
    )
    return FoundCamera(camera=camera.with_pose(current.cam_from_world), report=report)


def render_masked(renderer: Renderer, gaussians: Gaussians, camera: Camera) -> MaskedImage:
    """Draw the Gaussians on black for matching; the object is where alpha exceeds one half."""
    rendering = renderer.render(gaussians, camera)
    rgb = rendering.rgb.detach().cpu().numpy()
    return MaskedImage(
        rgb=np.rint(np.clip(rgb, 0, 1) * 255).astype(np.uint8),
        mask=rendering.alpha.detach().cpu().numpy() > 0.5,
    )


def _solve_view(
    gaussians: Gaussians,
    view: RankedView,
    camera: Camera,
    tools: CameraTools,
    threshold_px: float,
) -> _Solve:
    """Solve the pose from the keypoints that a capture view shares with the frame."""
    if view.matches is None or len(view.matches) == 0:
        return _Solve(camera=camera, match_count=0, inlier_count=0, error_px=np.nan, moved_px=0.0)
    seen = tools.renderer.visibility(gaussians, camera)
    lifted = lift_matches(
        view.matches, seen.centres_px, seen.visible_shares, max_distance_px=threshold_px
    )
    return _solve(gaussians, lifted, camera, threshold_px)


def _solve(
    gaussians: Gaussians, lifted: GaussianMatches, camera: Camera, threshold_px: float
) -> _Solve:
    points = gaussians.means.detach().cpu().numpy().astype(np.float64)[lifted.gaussian_ids]
    result = solve_pnp(points, lifted.target_px, camera, threshold_px=threshold_px)
    if not result.succeeded:
        return _Solve(
            camera=camera,
            match_count=len(lifted),
            inlier_count=0,
            error_px=np.nan,
            moved_px=0.0,
        )
    found = camera.with_pose(result.cam_from_world)
    before_px, _ = camera.project(points[result.inliers])
    after_px, _ = found.project(points[result.inliers])
    return _Solve(
        camera=found,
        match_count=len(lifted),
        inlier_count=int(np.count_nonzero(result.inliers)),
        error_px=float(np.median(result.errors_px[result.inliers])),
        moved_px=float(np.median(np.linalg.norm(after_px - before_px, axis=1))),
    )


def _overlap(first: np.ndarray, second: np.ndarray) -> float:
    union = np.count_nonzero(first | second)
    return float(np.count_nonzero(first & second) / union) if union else 0.0
