"""How poses change: by how much, the same change done to another pose, motion that goes on as it was."""

import numpy as np

from animator import quaternions
from animator.types import AnchorPoses


def carried(before: AnchorPoses, after: AnchorPoses, poses: AnchorPoses) -> AnchorPoses:
    """Do to a pose what leads from one pose to another.

    Args:
        before: The pose before the change.
        after: The pose after it.
        poses: The pose to change alike.

    Returns:
        Every anchor of it turned and shifted in world space as from `before` to `after`.
    """
    turns = quaternions.multiply(after.quats_wxyz, quaternions.conjugate(before.quats_wxyz))
    return AnchorPoses(
        quats_wxyz=quaternions.normalize(quaternions.multiply(turns, poses.quats_wxyz)),
        translations=poses.translations + (after.translations - before.translations),
    )


def extrapolated(before: AnchorPoses, last: AnchorPoses) -> AnchorPoses:
    """Continue from one pose to the next by as much again, at constant velocity."""
    return carried(before, last, last)


def step_length(one: AnchorPoses, other: AnchorPoses) -> float:
    """Measure how far the fastest twentieth of the anchors moved at least [scene unit]."""
    moved = (other.translations - one.translations).norm(dim=1)
    return float(np.percentile(moved.detach().cpu().numpy(), 95))
