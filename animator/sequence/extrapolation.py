"""Where the anchors are if they go on as they did."""

import torch

from animator import quaternions
from animator.types import AnchorPoses


def extrapolated(before: AnchorPoses, last: AnchorPoses) -> AnchorPoses:
    """Continue from one pose to the next by as much again, at constant velocity.

    Args:
        before: The pose before the last.
        last: The last pose.

    Returns:
        The pose as far beyond the last as that is beyond the one before it.
    """
    between = quaternions.multiply(last.quats_wxyz, quaternions.conjugate(before.quats_wxyz))
    return AnchorPoses(
        quats_wxyz=quaternions.normalize(quaternions.multiply(between, last.quats_wxyz)),
        translations=torch.lerp(before.translations, last.translations, 2.0),
    )
