"""Matcher `auto`: optical flow where the motion is small, learned seeds where it is not."""

import logging
from collections.abc import Callable

import numpy as np

from animator.match.flow import FlowMatcher
from animator.match.grid_matches import grid_matches
from animator.match.protocol import FlowField, MaskedImage, Matcher
from animator.match.xfeat import XFeatMatcher
from animator.types import Matches

MIN_TRUSTED_SHARE = 0.6
"""Optical flow that closes its round trip on less of the object than this has lost the motion."""
MAX_MOTION_SHARE = 0.06
"""Beyond this motion, as a share of the object's size, optical flow is no longer reliable."""

_log = logging.getLogger(__name__)


class AutoMatcher:
    """Tries the cheap matcher, measures the motion, calls the strong one where it is large."""

    name = "auto"

    def __init__(
        self,
        *,
        small_motion: Matcher | None = None,
        load_large_motion: Callable[[], Matcher] = XFeatMatcher,
    ):
        """Set the two matchers.

        Args:
            small_motion: Cheap matcher; optical flow if not given.
            load_large_motion: Makes the strong matcher when it is first needed; XFeat if not given.
        """
        self._small_motion = small_motion or FlowMatcher()
        self._load_large_motion = load_large_motion
        self._large_motion: Matcher | None = None

    def flow(self, source: MaskedImage, target: MaskedImage) -> FlowField:
        """Match densely; see `Matcher.flow`. `FlowField.matcher` names the choice."""
        small = self._small_motion.flow(source, target)
        share = small.trusted_share(source.mask)
        motion = _motion_share(small, source)
        if share >= MIN_TRUSTED_SHARE and motion <= MAX_MOTION_SHARE:
            _log.debug("auto: flow (trusted %.0f %%, motion %.1f %%)", 100 * share, 100 * motion)
            return small
        if self._large_motion is None:
            self._large_motion = self._load_large_motion()
        large = self._large_motion.flow(source, target)
        large_share = large.trusted_share(source.mask)
        # Seeds from a barely textured object can be worse than the flow they were to replace.
        chosen = large if large_share > 0.8 * share else small
        _log.debug(
            "auto: %s (flow: trusted %.0f %%, motion %.1f %% of the object; %s: trusted %.0f %%)",
            chosen.matcher,
            100 * share,
            100 * motion,
            large.matcher,
            100 * large_share,
        )
        return chosen

    def match(self, source: MaskedImage, target: MaskedImage) -> Matches:
        """Match on a grid; see `Matcher.match`."""
        return grid_matches(self.flow(source, target))


def _motion_share(flow: FlowField, source: MaskedImage) -> float:
    """Return the median trusted displacement over the object's size, 0 if nothing is trusted."""
    trusted = flow.confidences > 0
    if not trusted.any():
        return 0.0
    lengths = np.linalg.norm(flow.flow_px[trusted], axis=-1)
    return float(np.median(lengths) / source.object_size_px)
