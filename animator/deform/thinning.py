"""The object with fewer Gaussians: good enough to tell where its limbs are, and faster."""

import dataclasses
import math

from animator.types import Anchors, Gaussians


def thinned(gaussians: Gaussians, anchors: Anchors, most: int) -> tuple[Gaussians, Anchors]:
    """Keep every k-th Gaussian, grown so that together they cover what all did.

    Args:
        gaussians: The object.
        anchors: Its anchors.
        most: Gaussians to keep at most.

    Returns:
        The Gaussians that are left, and the anchors with their skinning weights.
    """
    every = math.ceil(len(gaussians) / most)
    kept = {
        field.name: getattr(gaussians, field.name)[::every].contiguous()
        for field in dataclasses.fields(Gaussians)
    }
    kept["scales"] = kept["scales"] * math.sqrt(every)
    return Gaussians(**kept), anchors.carrying(slice(None, None, every))
