"""Matcher `xfeat`: learned seeds carried to every pixel, for large motion."""

import logging

import numpy as np

from animator.match.features import FeatureMatcher
from animator.match.flow import FlowMatcher
from animator.match.grid_matches import STRIDE_PX, grid_matches
from animator.match.local_affine import agreeing_matches, interpolate_flow
from animator.match.protocol import FlowField, MaskedImage
from animator.match.trust import NormalizedPair, TrustLimits, trusted_flow
from animator.match.window import untrusted_flow, window_around
from animator.types import Matches

MIN_SEED_COUNT = 12
"""With fewer seeds there is nothing to interpolate; the small-motion flow is returned instead."""

_SEED_REACH_PX = 28.0  # farther from any seed the interpolation is a guess [working px]
_REFINE_ROUNDS = 2
_SMALL_MOTION_STRIDE_PX = 6
_SMALL_MOTION_LIMITS = TrustLimits(round_trip_px=1.0, correlation=0.7)

_log = logging.getLogger(__name__)


class XFeatMatcher:
    """Follows motion up to about half the object's size, densely around what the seeds can reach.

    XFeat + LighterGlue seeds and small-motion seeds from optical flow -> those that agree with
    their neighbours -> locally affine interpolation -> warp and refine -> round trip, correlation
    and seed distance.
    """

    name = "xfeat"

    def __init__(
        self,
        *,
        features: FeatureMatcher | None = None,
        limits: TrustLimits | None = None,
    ):
        """Set the parts.

        Args:
            features: Feature extractor to share; loaded from the installed wheel if not given.
            limits: When to trust a displacement.
        """
        self._features = features or FeatureMatcher()
        self._limits = limits or TrustLimits()
        self._small_motion = FlowMatcher(refine_rounds=0, limits=_SMALL_MOTION_LIMITS)

    def flow(self, source: MaskedImage, target: MaskedImage) -> FlowField:
        """Match densely; see `Matcher.flow`.

        Raises:
            ValueError: If the images differ in size.
        """
        window = window_around(source, target)
        if window is None:
            return untrusted_flow(source, self.name)
        source_cut, target_cut = window.cut(source), window.cut(target)
        pair = NormalizedPair.of(source_cut, target_cut)
        seeds = self._seeds(source_cut, target_cut, pair)
        if len(seeds) < MIN_SEED_COUNT:
            _log.info("xfeat: only %d seeds agree, optical flow alone is used", len(seeds))
            work = FlowMatcher(limits=self._limits).flow_in_window(pair)
        else:
            work = self._flow_from_seeds(pair, seeds)
        return window.paste(work, source, target)

    def match(self, source: MaskedImage, target: MaskedImage) -> Matches:
        """Match on a grid; see `Matcher.match`."""
        return grid_matches(self.flow(source, target))

    def _seeds(self, source: MaskedImage, target: MaskedImage, pair: NormalizedPair) -> Matches:
        learned = self._features.match(
            self._features.extract_uncropped(source), self._features.extract_uncropped(target)
        )
        learned = _agreeing(learned)
        small = grid_matches(
            self._small_motion.flow_in_window(pair), stride_px=_SMALL_MOTION_STRIDE_PX
        )
        both = Matches(
            source_px=np.concatenate([learned.source_px, small.source_px]),
            target_px=np.concatenate([learned.target_px, small.target_px]),
            confidences=np.concatenate([learned.confidences, small.confidences]),
        )
        return _agreeing(both)

    def _flow_from_seeds(self, pair: NormalizedPair, seeds: Matches) -> FlowField:
        height, width = pair.source_mask.shape
        size = {"height_px": height, "width_px": width}
        flows = (
            interpolate_flow(seeds.source_px, seeds.target_px, **size),
            interpolate_flow(seeds.target_px, seeds.source_px, **size),
        )
        flows = pair.refined(flows, rounds=_REFINE_ROUNDS)
        flow = trusted_flow(pair, flows, limits=self._limits, matcher=self.name)
        flow.confidences[_distance_to(seeds.source_px, height, width) > _SEED_REACH_PX] = 0
        return drop_disagreeing(flow)


def _agreeing(matches: Matches) -> Matches:
    kept = agreeing_matches(matches.source_px, matches.target_px)
    return Matches(
        source_px=matches.source_px[kept],
        target_px=matches.target_px[kept],
        confidences=matches.confidences[kept],
    )


def _distance_to(points_px: np.ndarray, height_px: int, width_px: int) -> np.ndarray:
    """Return each pixel's distance to the nearest pixel that holds a point [px], shape (H, W)."""
    import cv2

    empty = np.ones((height_px, width_px), np.uint8)
    columns, rows = points_px.astype(np.int64).T
    empty[rows.clip(0, height_px - 1), columns.clip(0, width_px - 1)] = 0
    return cv2.distanceTransform(empty, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def drop_disagreeing(flow: FlowField) -> FlowField:
    """Return the flow without the trust in displacements that their neighbours contradict.

    Judged on the match grid; a pixel shares the fate of the grid cell it lies in.
    """
    matches = grid_matches(flow)
    kept = agreeing_matches(matches.source_px, matches.target_px, passes=1)
    height, width = flow.confidences.shape
    cells = np.zeros((-(-height // STRIDE_PX), -(-width // STRIDE_PX)), bool)
    columns, rows = (matches.source_px[kept] // STRIDE_PX).astype(np.int64).T
    cells[rows, columns] = True
    agrees = cells.repeat(STRIDE_PX, axis=0).repeat(STRIDE_PX, axis=1)[:height, :width]
    return FlowField(
        flow_px=flow.flow_px,
        confidences=np.where(agrees, flow.confidences, 0).astype(np.float32),
        matcher=flow.matcher,
    )
