"""How much of the true motion was found, and where the error lies."""

import dataclasses

import numpy as np

from animator.report.quality import rigid_residual

_MIN_RIGID_POINTS = 30
"""Fewer points of a part say nothing about its shape."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PointTracks:
    """P points over the T frames that were found, true and found; the first frame is at rest."""

    numbers: tuple[int, ...]
    """Frame numbers, length T."""
    is_scored: np.ndarray
    """Which frames count, bool, shape (T,); not those given, such as the first."""
    rest: np.ndarray
    """True points at rest [scene unit], shape (P, 3)."""
    true: np.ndarray
    """Shape (T, P, 3)."""
    found: np.ndarray
    """Shape (T, P, 3)."""
    is_seen: np.ndarray
    """Whether the clip's camera sees a point, bool, shape (T, P)."""
    is_outer: np.ndarray
    """Whether a point counts, bool, shape (P,)."""
    part_ids: np.ndarray
    """The part of each point, -1 for none, shape (P,)."""
    part_names: tuple[str, ...]
    has_rigid_parts: bool
    camera_positions: np.ndarray
    """Where the clip's camera is [scene unit], shape (T, 3)."""
    diagonal: float
    """Of the object at rest [scene unit]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class PointErrors:
    """Errors of some points, as means [% of the diagonal]; NaN where there are none."""

    captured: float
    """1 - sum |found - true| / sum |true - rest|: 1 is perfect, 0 is a model left at rest; NaN for
    points that do not move."""
    epe_percent: float
    """Mean distance from the true place, the end-point error."""
    lateral_percent: float
    """Its part across the ray of the clip's camera."""
    depth_percent: float
    """Its part along the ray."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameErrors:
    """One frame."""

    number: int
    all: PointErrors
    seen: PointErrors
    unseen: PointErrors
    rigid_error_percent: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class PartErrors:
    """One part over all scored frames."""

    name: str
    points: int
    """Points that count."""
    all: PointErrors
    rigid_error_percent: float
    """NaN if the part is not rigid, or has too few points to tell."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class MotionScores:
    """One scene."""

    all: PointErrors
    seen: PointErrors
    """Of points while the clip's camera sees them."""
    unseen: PointErrors
    jitter: float
    """RMS second difference over that of the truth: 1 is as smooth as the truth, NaN below three
    frames or where the truth does not accelerate."""
    rigid_error_percent: float
    """Mean over rigid parts and frames of the RMS distance from the best rigid fit [% of the
    diagonal]: how much was bent that is rigid. NaN without rigid parts."""
    frames: tuple[FrameErrors, ...]
    parts: tuple[PartErrors, ...]


def score_motion(tracks: PointTracks) -> MotionScores:
    """Compare found with true points, over the outer points of the scored frames."""
    errors = _Errors(tracks)
    everywhere = np.broadcast_to(tracks.is_outer, tracks.is_seen.shape)
    seen, unseen = everywhere & tracks.is_seen, everywhere & ~tracks.is_seen
    rigid_errors = _rigid_errors(tracks)
    scored = np.flatnonzero(tracks.is_scored)
    frames = []
    for frame in scored:
        only = np.zeros((len(tracks.numbers), 1), bool)
        only[frame] = True
        frames.append(
            FrameErrors(
                number=tracks.numbers[frame],
                all=errors.where(everywhere & only),
                seen=errors.where(seen & only),
                unseen=errors.where(unseen & only),
                rigid_error_percent=_mean(rigid_errors[frame]),
            )
        )
    parts = []
    for part, name in enumerate(tracks.part_names):
        members = tracks.is_outer & (tracks.part_ids == part)
        if members.any():
            parts.append(
                PartErrors(
                    name=name,
                    points=int(members.sum()),
                    all=errors.where(everywhere & members),
                    rigid_error_percent=_mean(rigid_errors[scored, part]),
                )
            )
    return MotionScores(
        all=errors.where(everywhere),
        seen=errors.where(seen),
        unseen=errors.where(unseen),
        jitter=_jitter(tracks),
        rigid_error_percent=_mean(rigid_errors[scored]),
        frames=tuple(frames),
        parts=tuple(parts),
    )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PointDistances:
    """How far each point is from its true place [scene unit], shapes (T, P)."""

    total: np.ndarray
    lateral: np.ndarray
    """Across the ray of the clip's camera to the true place."""
    depth: np.ndarray
    """Along it."""

    @classmethod
    def of(cls, tracks: PointTracks) -> "PointDistances":
        """Split the errors of all points."""
        difference = tracks.found - tracks.true
        rays = tracks.true - tracks.camera_positions[:, None]
        rays /= np.maximum(np.linalg.norm(rays, axis=-1, keepdims=True), 1e-12)
        along = (difference * rays).sum(axis=-1)
        return cls(
            total=np.linalg.norm(difference, axis=-1),
            lateral=np.linalg.norm(difference - along[..., None] * rays, axis=-1),
            depth=np.abs(along),
        )


class _Errors:
    """Distances of all points in all frames, to be averaged over some of them."""

    def __init__(self, tracks: PointTracks) -> None:
        self._distances = PointDistances.of(tracks)
        self._moved = np.linalg.norm(tracks.true - tracks.rest, axis=-1)
        self._is_scored = tracks.is_scored[:, None]
        self._percent = 100.0 / max(tracks.diagonal, 1e-12)

    def where(self, is_chosen: np.ndarray) -> PointErrors:
        """Average over the scored frames of chosen points, bool, shape (T, P)."""
        chosen = is_chosen & self._is_scored
        if not chosen.any():
            nan = float("nan")
            return PointErrors(
                captured=nan, epe_percent=nan, lateral_percent=nan, depth_percent=nan
            )
        moved = float(self._moved[chosen].sum())
        missed = float(self._distances.total[chosen].sum())
        return PointErrors(
            captured=1.0 - missed / moved if moved > 0 else float("nan"),
            epe_percent=float(self._distances.total[chosen].mean()) * self._percent,
            lateral_percent=float(self._distances.lateral[chosen].mean()) * self._percent,
            depth_percent=float(self._distances.depth[chosen].mean()) * self._percent,
        )


def _rigid_errors(tracks: PointTracks) -> np.ndarray:
    """Return how far each part is from rigid [% of the diagonal], NaN if unknown, shape (T, parts)."""
    errors = np.full((len(tracks.numbers), len(tracks.part_names)), np.nan)
    if not tracks.has_rigid_parts:
        return errors
    for part in range(len(tracks.part_names)):
        members = np.flatnonzero(tracks.is_outer & (tracks.part_ids == part))
        if len(members) < _MIN_RIGID_POINTS:
            continue
        one_group = np.zeros(len(members), np.int64)
        for frame in range(len(tracks.numbers)):
            residual = rigid_residual(tracks.rest[members], tracks.found[frame, members], one_group)
            errors[frame, part] = 100.0 * residual / tracks.diagonal
    return errors


def _jitter(tracks: PointTracks) -> float:
    if len(tracks.numbers) < 3:
        return float("nan")
    found, true = (
        np.sqrt(np.square(np.diff(points[:, tracks.is_outer], n=2, axis=0)).sum(-1).mean())
        for points in (tracks.found, tracks.true)
    )
    return float(found / true) if true > 1e-9 * tracks.diagonal else float("nan")


def _mean(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else float("nan")
