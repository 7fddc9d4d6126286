"""Solved frames on other anchors: a finer rig takes over from where a coarser one has come."""

import dataclasses
from collections.abc import Sequence

from animator.deform.anchors import nearest_gaussians
from animator.deform.skinning import Skinner
from animator.sequence.solved_frame import SolvedFrame
from animator.types import AnchorPoses, Anchors, AnchorUncertainty, Gaussians


def rebound(
    frames: Sequence[SolvedFrame], gaussians: Gaussians, before: Anchors, after: Anchors
) -> list[SolvedFrame]:
    """Give solved frames poses of other anchors.

    Args:
        frames: The frames, solved with the anchors before.
        gaussians: The rest pose that both sets of anchors carry.
        before: The anchors until now.
        after: The anchors from now on: each is carried as the Gaussian nearest to it was.

    Returns:
        The frames, poses and uncertainty of the anchors `after`; what was at rest is exactly at rest.
    """
    carriers = before.carrying(nearest_gaussians(gaussians, after))
    rest = AnchorPoses.identity(after)
    skinner = Skinner(carriers, after.positions, rest.quats_wxyz)
    places_at_rest, _ = skinner(AnchorPoses.identity(before))

    def posed(poses: AnchorPoses) -> AnchorPoses:
        places, quats_wxyz = skinner(poses)
        return AnchorPoses(quats_wxyz=quats_wxyz, translations=places - places_at_rest)

    def known(uncertainty: AnchorUncertainty | None) -> AnchorUncertainty | None:
        if uncertainty is None:
            return None
        return AnchorUncertainty(
            along_ray=carriers.blended(uncertainty.along_ray),
            across_ray=carriers.blended(uncertainty.across_ray),
        )

    return [
        dataclasses.replace(frame, poses=posed(frame.poses), uncertainty=known(frame.uncertainty))
        for frame in frames
    ]
