"""What interpolating over left-out keys changes, at the keys and between them.

Bounds for every moment follow from the values at the original keys alone:

* A track of translations and the same one with fewer keys are both straight between two original
  keys, so their distance is largest at one of these.
* Two unit quaternions x, y that turn steadily by the arcs a and b have a squared chord g = |x - y|^2
  with g'' >= -(a^2 + b^2) g, as x'' = -a^2 x on the 3-sphere. By Sturm's comparison g is at most the
  larger of its values at the ends, over cos(sqrt(a^2 + b^2) / 2).
"""

import dataclasses

import numpy as np

from exporters import quaternions
from exporters.clip import Tracks

NORMALIZED_LERP_ARC = 0.0184
"""Normalized linear interpolation leaves the slerp by at most this times the cube of the arc.

To third order it is u (1 - u) (1 - 2u) / 6 <= 0.01604; the largest ratio up to an arc of pi / 2,
beyond which the other arc is shorter, is 0.01835, at pi / 2.
"""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Spans:
    """The kept keys around each of the T - 1 segments between neighboring original keys."""

    starts: np.ndarray
    """The last kept key not after the segment's first one, shape (T - 1, J)."""
    ends: np.ndarray
    """The first kept key not before the segment's last one, shape (T - 1, J)."""

    @classmethod
    def between(cls, kept: np.ndarray) -> "Spans":
        """Find the spans of keys kept, bool, shape (T, J); first and last are."""
        keys = np.arange(len(kept))[:, None]
        starts = np.maximum.accumulate(np.where(kept, keys, 0), axis=0)
        ends = np.minimum.accumulate(np.where(kept, keys, len(kept) - 1)[::-1], axis=0)[::-1]
        return cls(starts=starts[:-1], ends=ends[1:])

    def interpolate(self, tracks: Tracks, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate over the spans at a share, 0..1, of each segment.

        Returns:
            Translations, shape (T - 1, J, 3), and unit rotations wxyz, shape (T - 1, J, 4).
        """
        joints = np.arange(self.starts.shape[1])
        times_s = tracks.times_s
        moments_s = (times_s[:-1] + share * np.diff(times_s))[:, None]
        start_s = times_s[self.starts]
        shares = ((moments_s - start_s) / (times_s[self.ends] - start_s))[..., None]
        start, end = (tracks.translations[keys, joints] for keys in (self.starts, self.ends))
        translations = (1 - shares) * start + shares * end
        start, end = (tracks.quats_wxyz[keys, joints] for keys in (self.starts, self.ends))
        return translations, quaternions.slerp(start, end, shares)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SpanErrors:
    """How far joints are off their original parent-local tracks, each of shape (T - 1, J)."""

    lengths: np.ndarray
    """Distance of the translations [scene unit]."""
    chords: np.ndarray
    """Chord between the unit quaternions, 0..2."""


def span_errors(tracks: Tracks, spans: Spans) -> tuple[SpanErrors, SpanErrors]:
    """Compare the tracks with those that skip the keys within the spans.

    Returns:
        The errors at the first key of each segment, and bounds of the errors within the segments.
    """
    translations, start_wxyz = spans.interpolate(tracks, 0.0)
    end_wxyz = spans.interpolate(tracks, 1.0)[1]
    lengths = np.linalg.norm(translations - tracks.translations[:-1], axis=-1)
    # One sign for both ends of a segment: the bound between them needs one unbroken path.
    cosines = np.einsum("tji,tji->tj", start_wxyz, tracks.quats_wxyz[:-1])[..., None]
    signs = np.where(cosines < 0, -1.0, 1.0)
    start_chords = np.linalg.norm(signs * start_wxyz - tracks.quats_wxyz[:-1], axis=-1)
    end_chords = np.linalg.norm(signs * end_wxyz - tracks.quats_wxyz[1:], axis=-1)

    keys = np.arange(len(tracks))[:, None]
    segment_arcs = _arcs(tracks.quats_wxyz, keys[:-1], keys[1:])
    span_arcs = _arcs(tracks.quats_wxyz, spans.starts, spans.ends)
    durations_s = tracks.times_s[spans.ends] - tracks.times_s[spans.starts]
    arcs_here = span_arcs * np.diff(tracks.times_s)[:, None] / durations_s
    bulges = 1 / np.sqrt(np.cos(np.hypot(segment_arcs, arcs_here) / 2))

    is_skipped = spans.ends - spans.starts > 1  # else exactly zero, not up to rounding
    normalized_lerp = NORMALIZED_LERP_ARC * span_arcs**3
    at_keys = SpanErrors(
        lengths=is_skipped * lengths, chords=is_skipped * (start_chords + normalized_lerp)
    )
    within_chords = np.maximum(start_chords, end_chords) * bulges + normalized_lerp
    next_lengths = np.concatenate([at_keys.lengths[1:], np.zeros_like(lengths[:1])])
    within = SpanErrors(
        lengths=np.maximum(at_keys.lengths, next_lengths), chords=is_skipped * within_chords
    )
    return at_keys, within


def _arcs(quats_wxyz: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the shorter arcs between quaternions of two keys [rad], 0..pi / 2, (T - 1, J)."""
    joints = np.arange(quats_wxyz.shape[1])
    cosines = np.einsum("tji,tji->tj", quats_wxyz[starts, joints], quats_wxyz[ends, joints])
    return np.arccos(np.clip(np.abs(cosines), 0.0, 1.0))
