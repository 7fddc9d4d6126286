"""Camera pose from points and where they are seen."""

import dataclasses

import numpy as np

from animator.types import Camera

MIN_POINT_COUNT = 6
"""Fewer correspondences leave no redundancy to tell a pose from an accident."""

_REFINE_ROUNDS = 3


@dataclasses.dataclass(frozen=True, kw_only=True)
class PnPOptions:
    """How hard to look and what to accept."""

    iterations: int = 1000
    """RANSAC samples at most; with 40 % outliers 100 already suffice."""
    confidence: float = 0.9999
    """Probability of an all-inlier sample at which RANSAC stops early."""
    min_inlier_share: float = 0.2
    """Smallest share of inliers of a pose; by accident a few per cent agree."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PnPResult:
    """A pose and who supports it."""

    cam_from_world: np.ndarray
    """World to camera, OpenCV axes, float64, shape (4, 4); the given one on failure."""
    inliers: np.ndarray
    """True for each correspondence within the threshold, bool, shape (M,); all False on failure."""
    errors_px: np.ndarray
    """Reprojection error of each pair [px], inf behind the camera, float64, shape (M,)."""

    @property
    def succeeded(self) -> bool:
        """Whether a pose was found."""
        return bool(self.inliers.any())


def solve_pnp(
    points: np.ndarray,
    target_px: np.ndarray,
    camera: Camera,
    *,
    threshold_px: float,
    options: PnPOptions | None = None,
) -> PnPResult:
    """Find the pose from which `points` are seen at `target_px`, with some of the pairs wrong.

    RANSAC over EPnP (Lepetit et al., IJCV 2009), then Levenberg-Marquardt on the inliers, which are
    chosen anew after each round. Deterministic: OpenCV seeds this RANSAC with a constant.

    Args:
        points: World positions [scene unit], shape (M, 3).
        target_px: Where each is seen, pixel centres at +0.5, shape (M, 2).
        camera: Its intrinsics are used; its pose is returned on failure.
        threshold_px: Largest reprojection error of an inlier [px]; use a share of the object's
            size.
        options: Effort and acceptance.

    Returns:
        The pose and its inliers; no inliers at all if there is no pose that enough pairs support.
    """
    options = options or PnPOptions()
    points = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
    target = np.ascontiguousarray(target_px, np.float64).reshape(-1, 2)
    usable = np.isfinite(points).all(axis=1) & np.isfinite(target).all(axis=1)
    failure = _judge(points, target, camera, np.zeros(len(points), bool))
    if np.count_nonzero(usable) < MIN_POINT_COUNT:
        return failure
    needed = max(MIN_POINT_COUNT, options.min_inlier_share * np.count_nonzero(usable))

    pose = _ransac(points[usable], target[usable], camera, threshold_px, options)
    if pose is None:
        return failure
    inliers = np.zeros(len(points), bool)
    for _ in range(_REFINE_ROUNDS):
        errors = reprojection_errors(points, target, camera.with_pose(pose))
        reached = errors < threshold_px
        if np.count_nonzero(reached) < needed:
            return failure
        if (reached == inliers).all():
            break
        inliers = reached
        pose = _refine(points[inliers], target[inliers], camera, pose)
    found = camera.with_pose(pose)
    inliers = reprojection_errors(points, target, found) < threshold_px
    if np.count_nonzero(inliers) < needed:
        return failure
    return _judge(points, target, found, inliers)


def reprojection_errors(points: np.ndarray, target_px: np.ndarray, camera: Camera) -> np.ndarray:
    """Measure how far each point projects from where it is seen.

    Args:
        points: World positions [scene unit], shape (M, 3).
        target_px: Where each is seen, pixel centres at +0.5, shape (M, 2).
        camera: The camera.

    Returns:
        Distances [px], inf for points behind the camera or not finite, float64, shape (M,).
    """
    errors = np.full(len(points), np.inf)
    usable = np.isfinite(points).all(axis=1) & np.isfinite(target_px).all(axis=1)
    projected, depths = camera.project(points[usable])
    distances = np.linalg.norm(projected - target_px[usable], axis=1)
    errors[usable] = np.where(depths > 0, distances, np.inf)
    return errors


def _judge(
    points: np.ndarray, target_px: np.ndarray, camera: Camera, inliers: np.ndarray
) -> PnPResult:
    return PnPResult(
        cam_from_world=camera.cam_from_world,
        inliers=inliers,
        errors_px=reprojection_errors(points, target_px, camera),
    )


def _ransac(
    points: np.ndarray,
    target_px: np.ndarray,
    camera: Camera,
    threshold_px: float,
    options: PnPOptions,
) -> np.ndarray | None:
    import cv2

    # OpenCV minds only that points and principal point count pixels alike; ours both have centres
    # at +0.5.
    try:
        found, rotation, translation, _ = cv2.solvePnPRansac(
            points,
            target_px,
            camera.intrinsics,
            None,
            iterationsCount=options.iterations,
            reprojectionError=threshold_px,
            confidence=options.confidence,
            flags=cv2.SOLVEPNP_EPNP,
        )
    except (
        cv2.error
    ):  # raised where no sample has a solution, for instance when all points coincide
        return None
    return _pose(rotation, translation) if found else None


def _refine(
    points: np.ndarray, target_px: np.ndarray, camera: Camera, cam_from_world: np.ndarray
) -> np.ndarray:
    import cv2

    rotation, _ = cv2.Rodrigues(cam_from_world[:3, :3])
    translation = cam_from_world[:3, 3:].copy()
    refined = cv2.solvePnPRefineLM(
        points, target_px, camera.intrinsics, None, rotation, translation
    )
    return _pose(*refined)


def _pose(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    import cv2

    cam_from_world = np.eye(4)
    cam_from_world[:3, :3] = cv2.Rodrigues(rotation)[0]
    cam_from_world[:3, 3] = np.ravel(translation)
    return cam_from_world
