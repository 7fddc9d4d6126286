"""Keys of the joint tracks: values between them, continuous signs, the shared time base."""

import numpy as np

from exporters import quaternions
from exporters.clip import Clip, Tracks

WHOLE_CODE_TOLERANCE = 1e-6  # a time code this near a whole number is one: k / 24 * 24 may miss k


def interpolate(tracks: Tracks, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the parent-local joint transforms at one time, held outside the keys.

    Args:
        tracks: The keys.
        time_s: Time [s].

    Returns:
        Translations [scene unit], shape (J, 3), and unit rotations wxyz, shape (J, 4), float64.
    """
    times_s = tracks.times_s
    before = max(int(np.searchsorted(times_s, time_s, side="right")) - 1, 0)
    after = before + 1
    if after == len(times_s) or time_s <= times_s[before]:
        return tracks.translations[before], tracks.quats_wxyz[before]
    share = float((time_s - times_s[before]) / (times_s[after] - times_s[before]))
    translations = (1 - share) * tracks.translations[before] + share * tracks.translations[after]
    quats_wxyz = quaternions.slerp(tracks.quats_wxyz[before], tracks.quats_wxyz[after], share)
    return translations, quats_wxyz


def align_signs(quats_wxyz: np.ndarray, reference_wxyz: np.ndarray) -> np.ndarray:
    """Return the same rotations, each with the sign nearest to its reference. Shape (..., 4)."""
    cosines = np.einsum("...i,...i->...", quats_wxyz, reference_wxyz)
    opposite = cosines < 0
    return np.where(opposite[..., None], -quats_wxyz, quats_wxyz) if opposite.any() else quats_wxyz


def continue_signs(quats_wxyz: np.ndarray) -> np.ndarray:
    """Return the same rotations with signs continuous along the first axis.

    `q` and `-q` are one rotation, but tools that interpolate the four numbers would turn the long
    way round between them.

    Args:
        quats_wxyz: Unit rotations by key, shape (T, ..., 4).
    """
    cosines = np.einsum("...i,...i->...", quats_wxyz[1:], quats_wxyz[:-1])
    flips = np.cumprod(np.where(cosines < 0, -1, 1), axis=0).astype(quats_wxyz.dtype)
    continuous = np.array(quats_wxyz)
    continuous[1:] *= flips[..., None]
    return continuous


def key_codes(clip: Clip) -> np.ndarray:
    """Return the time code of each key, `times_s * fps`, float64, shape (T,), from 0."""
    codes = clip.tracks.times_s * clip.fps
    whole = np.round(codes)
    return np.where(np.abs(codes - whole) < WHOLE_CODE_TOLERANCE, whole, codes)


def frame_count(clip: Clip) -> int:
    """Return how many frames the baked caches hold: time codes 0, 1, ... up to the last key.

    A last key between two whole codes is followed by one more frame, which holds it.
    """
    return int(np.ceil(key_codes(clip)[-1])) + 1
