"""Matcher `flow`: optical flow on locally normalised images, for small motion."""

import numpy as np

from animator.match.grid_matches import grid_matches
from animator.match.protocol import FlowField, MaskedImage
from animator.match.trust import NormalizedPair, TrustLimits, trusted_flow
from animator.match.window import untrusted_flow, window_around
from animator.types import Matches


class FlowMatcher:
    """Follows motion up to a tenth of the object densely, to a fraction of a pixel."""

    name = "flow"

    def __init__(self, *, refine_rounds: int = 1, limits: TrustLimits | None = None):
        """Set the effort.

        Args:
            refine_rounds: How often to warp by the flow and match again.
            limits: When to trust a displacement.
        """
        self._refine_rounds = refine_rounds
        self._limits = limits or TrustLimits()

    def flow(self, source: MaskedImage, target: MaskedImage) -> FlowField:
        """Match densely; see `Matcher.flow`.

        Raises:
            ValueError: If the images differ in size.
        """
        window = window_around(source, target)
        if window is None:
            return untrusted_flow(source, self.name)
        pair = NormalizedPair.of(window.cut(source), window.cut(target))
        return window.paste(self.flow_in_window(pair), source, target)

    def match(self, source: MaskedImage, target: MaskedImage) -> Matches:
        """Match on a grid; see `Matcher.match`."""
        return grid_matches(self.flow(source, target))

    def flow_in_window(self, pair: NormalizedPair) -> FlowField:
        """Match a pair that is already cropped and normalised."""
        return trusted_flow(
            pair, self.flows_in_window(pair), limits=self._limits, matcher=self.name
        )

    def flows_in_window(self, pair: NormalizedPair) -> tuple[np.ndarray, np.ndarray]:
        """Return the flow there and the flow back [px], each shape (H, W, 2), without any trust."""
        return pair.refined(pair.flows(), rounds=self._refine_rounds)
