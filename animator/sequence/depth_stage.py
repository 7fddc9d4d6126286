"""Depth maps of the frames, given by the user: what they say of the Gaussians that a frame shows.

Calibrated by frame 0, whose pose is known: whether near is large or small, on which scale, and by how much each
Gaussian is said to be nearer or farther than it is. A network errs alike on the same surface from frame to frame, and
all of that drops out. All maps must be on one scale: one laid on the pose that is about to be solved would say that
this is right, as far as a scale and an offset go, and errors would feed themselves.
"""

import dataclasses
import logging

import numpy as np

from animator.deform.image_solver import ImageSolver
from animator.match.depth_lifting import DepthScale, lay_on
from animator.match.sampling import values_at
from animator.render.protocol import Renderer
from animator.sequence.target import Window
from animator.types import AnchorPoses, Camera, GaussianDepths

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DepthStageConfig:
    """Which Gaussians a map is asked about, and when it is believed."""

    least_visible: float = 0.3
    """Share of a Gaussian that must be visible."""
    least_count: int = 50
    """Gaussians with a value, below which a map says nothing."""
    worst_misfit: float = 0.5
    """Median distance of the map of frame 0 from the known depths, above which no map is believed [share of what a
    flat map has]."""
    worst_step: float = 0.1
    """Median distance of a later map from the depths so far, above which it is on another scale [diagonals]."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Calibration:
    """What frame 0 says about the maps."""

    scale: DepthScale
    """Of its map."""
    excess: np.ndarray
    """By how much each Gaussian is said to be too far [scene unit], 0 where frame 0 does not say, shape (N,)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Readings:
    """A map, read at M Gaussians that are visible in a pose."""

    gaussian_ids: np.ndarray
    """Indices of the Gaussians, int64, shape (M,)."""
    values: np.ndarray
    """What the map says, shape (M,)."""
    depths: np.ndarray
    """In that pose [scene unit], shape (M,)."""
    visible_shares: np.ndarray
    """How much of each is visible, 0..1, shape (M,)."""


class DepthStage:
    """Reads the depth maps of one clip."""

    def __init__(
        self,
        depth_maps: np.ndarray | None,
        image_solver: ImageSolver,
        renderer: Renderer,
        config: DepthStageConfig,
    ) -> None:
        self._depth_maps = depth_maps
        self._image_solver = image_solver
        self._renderer = renderer
        self._config = config
        self._calibration: _Calibration | None = None
        self._has_warned = False

    def calibrate(self, poses: AnchorPoses, camera: Camera) -> None:
        """Learn from frame 0 how to read the maps; without this they are not used.

        Args:
            poses: The pose of frame 0.
            camera: Its camera.
        """
        if self._depth_maps is None:
            return
        readings = self._read(0, poses, camera, Window.of_all(camera))
        scale = None if readings is None else self._scale_of(readings)
        if readings is None or scale is None:
            logger.warning(
                "The depth map of the first frame does not look like the object there: no depth map is used. "
                "Expected near to be large, or to be small, all over the object."
            )
            return
        excess = np.zeros(len(self._image_solver.gaussians))
        excess[readings.gaussian_ids] = scale.depths(readings.values) - readings.depths
        self._calibration = _Calibration(scale=scale, excess=excess)
        logger.info(
            "The depth maps are read as %s; in the first frame they are off by %.2g of the object's diagonal.",
            "inverse depth" if scale.is_inverse else "depth",
            scale.misfit(readings.values, readings.depths) / self._image_solver.gaussians.diagonal,
        )

    def find(
        self, index: int, poses: AnchorPoses, camera: Camera, window: Window
    ) -> GaussianDepths | None:
        """Say how far the visible Gaussians of a frame are.

        Args:
            index: Which frame.
            poses: About its pose: where Gaussians are drawn.
            camera: Sees the window.
            window: The part of the frame.

        Returns:
            Depths; None without maps, or where this one says nothing.
        """
        if self._calibration is None:
            return None
        readings = self._read(index, poses, camera, window)
        if readings is None:
            return None
        scale, excess = self._calibration.scale, self._calibration.excess
        depths = scale.depths(readings.values) - excess[readings.gaussian_ids]
        is_known = np.isfinite(depths)
        if not self._is_on_scale(index, depths[is_known], readings.depths[is_known]):
            return None
        return GaussianDepths(
            gaussian_ids=readings.gaussian_ids[is_known],
            depths=depths[is_known],
            confidences=readings.visible_shares[is_known],
        )

    def _is_on_scale(self, index: int, depths: np.ndarray, so_far: np.ndarray) -> bool:
        diagonal = self._image_solver.gaussians.diagonal
        off = float(np.median(np.abs(depths - so_far))) / diagonal if len(depths) else np.inf
        if off <= self._config.worst_step:
            return True
        if not self._has_warned:
            self._has_warned = True
            logger.warning(
                "The depth map of frame %d of the clip is not on the scale of the first one (off by %.2g of the "
                "object's diagonal): it is not used, nor are others like it. Bring all maps to one scale.",
                index,
                off,
            )
        return False

    def _read(
        self, index: int, poses: AnchorPoses, camera: Camera, window: Window
    ) -> _Readings | None:
        assert self._depth_maps is not None
        seen = self._renderer.visibility(self._image_solver.pose(poses), camera)
        values = values_at(window.cut(self._depth_maps[index]), seen.centres_px, outside=np.nan)
        usable = (seen.visible_shares > self._config.least_visible) & np.isfinite(values)
        ids = np.flatnonzero(usable)
        if len(ids) < self._config.least_count:
            return None
        return _Readings(
            gaussian_ids=ids,
            values=values[ids],
            depths=seen.depths[ids].astype(np.float64),
            visible_shares=seen.visible_shares[ids],
        )

    def _scale_of(self, readings: _Readings) -> DepthScale | None:
        """Return the scale that fits best, of depth or of inverse depth; None if a flat map fits nearly as well."""
        known = (readings.values, readings.depths)
        scales = [
            scale
            for is_inverse in (False, True)
            if (scale := lay_on(*known, is_inverse=is_inverse)) is not None
        ]
        flat = float(np.median(np.abs(readings.depths - np.median(readings.depths))))
        best = min(scales, key=lambda scale: scale.misfit(*known), default=None)
        if best is None or best.misfit(*known) > self._config.worst_misfit * flat:
            return None
        return best
