"""Keys that may go: no Gaussian leaves its path by more than a bound, at any time.

Each joint keeps some of its keys, always the first and the last, and translation and rotation the
same ones. `key_spans` bounds what is lost between the keys, too; from there to the Gaussians:

* A joint off by a length e and a chord c takes what hangs on it, itself and through its children,
  at most e + 2 c r away, where r is the farthest that any of it ever gets from the joint.
* The errors of a joint and its ancestors add up; a skinned point is a weighted mean of points, so
  its error is at most the largest of theirs.
"""

import dataclasses
import logging
from typing import TYPE_CHECKING

import numpy as np

from exporters import bounds, keyframes, posing
from exporters.clip import Clip, Tracks
from exporters.errors import WriteError
from exporters.key_spans import SpanErrors, Spans, span_errors
from exporters.options import ExportOptions

if TYPE_CHECKING:
    from scipy.sparse import csr_array

ROUNDING_RAD = 1e-9
"""Turns that double precision cannot tell from none [rad]: what a tolerance of 0 means."""

_log = logging.getLogger(__name__)


def find_kept_keys(clip: Clip, options: ExportOptions, *, shared: bool) -> np.ndarray:
    """Choose keys to keep such that the Gaussians and joints stay within the tolerances.

    No center of a Gaussian moves by more than `tolerance` diagonals of the rest pose's box, and no
    joint turns, in world space, by more than `tolerance_degrees`. Both hold up to float32 rounding.

    The joints' tracks are split where they are farthest off until nothing is too far off (Ramer
    1972, Douglas and Peucker 1973). The same clip gives the same keys.

    Args:
        clip: A valid clip of T keys and J joints.
        options: `tolerance` and `tolerance_degrees`.
        shared: Whether all joints must keep the same keys, as in a UsdSkelAnimation.

    Returns:
        Which keys each joint keeps, bool, shape (T, J).

    Raises:
        WriteError: If a tolerance is negative or not a number.
    """
    _check(options)
    kept = np.ones(clip.tracks.quats_wxyz.shape[:2], dtype=bool)
    diagonal = bounds.diagonal(clip)
    if options.tolerance == 0 or diagonal == 0 or len(kept) < 3:
        return kept
    kept[1:-1] = False
    angle_rad = max(np.radians(options.tolerance_degrees), ROUNDING_RAD)
    limits = _limits(clip, options.tolerance * diagonal, angle_rad)
    while True:
        spans = Spans.between(kept)
        at_keys, within = (limits.shares_used(errors) for errors in span_errors(clip.tracks, spans))
        if shared:
            at_keys[:] = at_keys.max(axis=1, keepdims=True)
            within[:] = within.max(axis=1, keepdims=True)
        farthest = _farthest_keys(spans, at_keys, is_over=within > 1)
        if not farthest.any():
            break
        kept[:-1] |= farthest
    if _log.isEnabledFor(logging.INFO):
        _log.info(
            "%s: %d of %d joint keys kept; the Gaussians move by at most %.2g of the diagonal "
            "(allowed %g)",
            clip.name,
            np.count_nonzero(kept),
            kept.size,
            measured_shift(clip, kept) / diagonal,
            options.tolerance,
        )
    return kept


def with_keys(tracks: Tracks, kept: np.ndarray) -> Tracks:
    """Return tracks with some of their keys only, signs continuous again.

    Args:
        tracks: T keys.
        kept: Which keys stay, the first one too, bool, shape (T,).
    """
    if kept.all():
        return tracks
    return Tracks(
        times_s=tracks.times_s[kept],
        translations=tracks.translations[kept],
        quats_wxyz=keyframes.continue_signs(tracks.quats_wxyz[kept]),
    )


def measured_shift(clip: Clip, kept: np.ndarray) -> float:
    """Return how far a Gaussian moves at most [scene unit], at the keys and half-way between.

    Args:
        clip: The clip with all keys.
        kept: Which keys each joint keeps, bool, shape (T, J).
    """
    rig, tracks = clip.rig, clip.tracks
    shift_of_points = _shift_matrix(clip)
    bind_inverse = np.linalg.inv(clip.bind_matrices())
    all_spans = Spans.between(np.ones_like(kept))
    kept_spans = Spans.between(kept)
    changed = np.flatnonzero((kept_spans.ends - kept_spans.starts > 1).any(axis=1))
    largest = 0.0
    for share in (0.0, 0.5):
        before = all_spans.interpolate(tracks, share)
        after = kept_spans.interpolate(tracks, share)
        for segment in changed:
            moved = posing.world_matrices(rig, after[0][segment], after[1][segment])
            moved -= posing.world_matrices(rig, before[0][segment], before[1][segment])
            columns = (moved @ bind_inverse)[:, :3].swapaxes(1, 2).reshape(-1, 3)
            shifts = shift_of_points @ columns
            largest = max(largest, float(np.sqrt(np.einsum("ni,ni->n", shifts, shifts).max())))
    return largest


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Limits:
    """What each joint may be off by itself, shape (J,)."""

    lengths: np.ndarray
    """Distance by which it may shift what hangs on it [scene unit]."""
    angles_rad: np.ndarray
    """Angle by which it may turn it [rad]."""
    reaches: np.ndarray
    """Farthest that anything which hangs on it ever gets from it [scene unit]."""

    def shares_used(self, errors: SpanErrors) -> np.ndarray:
        """Return the share of the limits that errors use up, shape (T - 1, J)."""
        # Turns apart by an angle t have quaternions apart by a chord 2 sin(t / 4), and move a unit
        # vector by at most 2 sin(t / 2), which is less than two of these chords.
        angles_rad = 4 * np.arcsin(np.minimum(errors.chords / 2, 1.0))
        shifts = errors.lengths + 2 * errors.chords * self.reaches
        return np.maximum(shifts / self.lengths, angles_rad / self.angles_rad)


def _limits(clip: Clip, length: float, angle_rad: float) -> _Limits:
    """Share the tolerances evenly among the joints of a path from the root that move at all."""
    rig, tracks = clip.rig, clip.tracks
    moves = (tracks.translations != tracks.translations[0]).any(axis=(0, 2))
    moves |= (tracks.quats_wxyz != tracks.quats_wxyz[0]).any(axis=(0, 2))
    above, below = moves.astype(int), moves.astype(int)
    for joint in range(1, len(rig)):
        above[joint] += above[rig.parents[joint]]
    for joint in range(len(rig) - 1, 0, -1):
        parent = rig.parents[joint]
        below[parent] = max(below[parent], below[joint] + moves[parent])
    on_path = np.maximum(above + below - moves, 1)
    return _Limits(lengths=length / on_path, angles_rad=angle_rad / on_path, reaches=_reaches(clip))


def _reaches(clip: Clip) -> np.ndarray:
    """Return how far the centers that hang on a joint get from it at most, shape (J,)."""
    rig, skin = clip.rig, clip.skin
    joint_from_world = np.linalg.inv(clip.bind_matrices())
    reaches = np.zeros(len(rig))
    for joint_ids, weights in zip(skin.joint_ids.T, skin.weights.T, strict=True):
        affine = joint_from_world[joint_ids, :3]
        local = np.einsum("nij,nj->ni", affine[:, :, :3], clip.splats.positions) + affine[:, :, 3]
        distances = np.where(weights > 0, np.linalg.norm(local, axis=1), 0.0)
        np.maximum.at(reaches, joint_ids.astype(np.intp), distances)
    offsets = np.linalg.norm(clip.tracks.translations, axis=-1).max(axis=0)
    for joint in range(len(rig) - 1, 0, -1):
        parent = rig.parents[joint]
        reaches[parent] = max(reaches[parent], offsets[joint] + reaches[joint])
    return reaches


def _farthest_keys(spans: Spans, used: np.ndarray, is_over: np.ndarray) -> np.ndarray:
    """Mark the skipped key that is farthest off in each span that is too far off anywhere.

    Args:
        spans: The kept keys.
        used: Shares of the limits at the first key of each segment, shape (T - 1, J).
        is_over: Whether the error within a segment is too large, bool, shape (T - 1, J).

    Returns:
        Whether to keep the first key of each segment, bool, shape (T - 1, J); of equals the first.
    """
    segment_count, joint_count = used.shape
    starts = spans.starts.T.ravel()  # joint by joint, so that spans are runs
    is_first = np.arange(segment_count * joint_count) % segment_count == starts
    used = np.where(is_first, -1.0, used.T.ravel())
    firsts = np.flatnonzero(is_first)
    span_ids = np.cumsum(is_first) - 1
    is_span_over = np.logical_or.reduceat(is_over.T.ravel(), firsts)
    largest = np.maximum.reduceat(used, firsts)
    candidates = np.flatnonzero(is_span_over[span_ids] & ~is_first & (used == largest[span_ids]))
    _, one_a_span = np.unique(span_ids[candidates], return_index=True)
    farthest = np.zeros(segment_count * joint_count, dtype=bool)
    farthest[candidates[one_a_span]] = True
    return farthest.reshape(joint_count, segment_count).T


def _shift_matrix(clip: Clip) -> "csr_array":
    """Return the matrix from rows of stacked (3, 4) joint matrices to skinned centers, (N, 4 J)."""
    from scipy.sparse import csr_array  # slow to import, and needed for a tolerance only

    skin, count = clip.skin, len(clip.splats)
    points = np.concatenate([clip.splats.positions, np.ones((count, 1))], axis=1)
    weights = skin.weights / skin.weights.sum(axis=1, keepdims=True)
    values = weights[:, :, None] * points[:, None, :]
    columns = 4 * skin.joint_ids[:, :, None] + np.arange(4)
    ends = np.arange(0, values.size + 1, values[0].size)
    return csr_array((values.ravel(), columns.ravel(), ends), shape=(count, 4 * len(clip.rig)))


def _check(options: ExportOptions) -> None:
    for name in ("tolerance", "tolerance_degrees"):
        value = getattr(options, name)
        if not (np.isfinite(value) and value >= 0):
            raise WriteError(f"{name}: expected a number, 0 or more, got {value}")
