"""Whether a frame shows anything that an earlier one did not: what does not move is not solved.

Solving a frame that shows no motion still moves the pose a little: no splat matches its picture
exactly, and freedom finds something to improve. So a frame like the one that the present pose was
solved from keeps that pose. Slow motion adds up until it shows, so it is delayed, not lost.
"""

import cv2
import numpy as np

from animator.sequence.target import FrameView

NEIGHBORHOOD_PX = 7
"""Side of the squares whose mean difference counts: noise averages out in them, moved edges do not."""
LEAST_DIFFERENCE = 1.0
"""Mean difference of such a square that shows motion in a clip without noise [8-bit levels]."""
MOST_NOISE = 2.0
"""Differences over the whole object up to this are taken for noise [8-bit levels]."""


def shows_the_same(view: FrameView, earlier: FrameView) -> bool:
    """Return whether two frames differ by noise alone.

    Noise is everywhere and motion has edges: the mean difference in the worst neighborhood is
    compared with the median difference over the object. The mean of half-normal differences is 1.2
    times their median, and over 49 pixels stays within a fifth of that: twice the median is noise.
    """
    premultiplied = [_on_black(view), _on_black(earlier)]
    differences = np.abs(premultiplied[0] - premultiplied[1]).mean(axis=2)
    is_object = (view.alpha > 0) | (earlier.alpha > 0)
    noise = float(np.median(differences[is_object])) if is_object.any() else 0.0
    worst = float(cv2.blur(differences, (NEIGHBORHOOD_PX, NEIGHBORHOOD_PX)).max())
    return worst <= LEAST_DIFFERENCE + 2.0 * min(noise, MOST_NOISE)


def _on_black(view: FrameView) -> np.ndarray:
    """Return color on black and coverage, 0..255, float32, shape (H, W, 4)."""
    coverage = view.alpha.astype(np.float32)[..., None]
    return np.concatenate([view.rgb * (coverage / 255.0), coverage], axis=2)
