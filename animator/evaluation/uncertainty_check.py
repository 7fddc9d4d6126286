"""Is the rig uncertain where it errs? Its claims against the true errors."""

import dataclasses

import numpy as np

from animator.evaluation.carried_points import CarriedPoints
from animator.evaluation.motion_scores import PointDistances, PointTracks
from animator.evaluation.rank_correlation import correlation
from exporters.clip import Clip


@dataclasses.dataclass(frozen=True, kw_only=True)
class UncertaintyScores:
    """Spearman's rank correlation of claimed uncertainty and true error, -1..1; NaN if unclaimed."""

    depth: float
    """Along the viewing rays."""
    lateral: float
    """Across them."""


UNCLAIMED = UncertaintyScores(depth=float("nan"), lateral=float("nan"))


def score_uncertainty(
    clip: Clip | None, carried: CarriedPoints, tracks: PointTracks
) -> UncertaintyScores:
    """Correlate over the outer points of the scored frames.

    Args:
        clip: The result; its joints' uncertainties are averaged by the skin, as their motion is.
        carried: The true points on the Gaussians of the clip.
        tracks: True and found points; each frame must be one that the clip was solved from.
    """
    if clip is None or clip.uncertainty is None:
        return UNCLAIMED
    key_of = {number: key for key, number in enumerate(clip.source_frames)}
    frames = [k for k in np.flatnonzero(tracks.is_scored) if tracks.numbers[k] in key_of]
    if not frames:
        return UNCLAIMED
    keys = [key_of[tracks.numbers[frame]] for frame in frames]
    distances = PointDistances.of(tracks)

    def agreement(errors: np.ndarray, of_joints: np.ndarray) -> float:
        claimed = np.stack([_at_points(clip, carried, of_joints[key]) for key in keys])
        return correlation(errors[frames][:, tracks.is_outer], claimed[:, tracks.is_outer])

    return UncertaintyScores(
        depth=agreement(distances.depth, clip.uncertainty.along_ray),
        lateral=agreement(distances.lateral, clip.uncertainty.across_ray),
    )


def _at_points(clip: Clip, carried: CarriedPoints, of_joints: np.ndarray) -> np.ndarray:
    """Carry a quantity of the joints to the Gaussians, and on to the points, shape (P,)."""
    of_gaussians = (of_joints[clip.skin.joint_ids] * clip.skin.weights).sum(axis=1)
    return carried.average(of_gaussians)
