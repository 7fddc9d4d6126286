"""Limbs swung to the sides: where a limb may be that moved farther than a descent reaches."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from animator.deform.limbs import Limb, line_of, turned
from animator.types import AnchorPoses, Anchors, Camera


@dataclasses.dataclass(frozen=True, kw_only=True)
class SwingConfig:
    """How far limbs are swung, and where to."""

    length: float = 0.5
    """Length of a limb [share of the way from its tip to the middle of the object]."""
    angle_deg: float = 45.0
    """How far they are swung."""
    sides: int = 4
    """To how many sides, the first away from the camera, evenly spread."""


def swung_poses(
    anchors: Anchors, poses: AnchorPoses, camera: Camera, limb: Limb, config: SwingConfig
) -> Iterator[AnchorPoses]:
    """Swing a limb about its base to one side after the other.

    Args:
        anchors: The anchors at rest.
        poses: The pose to swing it in.
        camera: Sees it.
        limb: The limb.
        config: How far, and where to.

    Yields:
        The pose for each side.
    """
    line = line_of(limb, anchors, poses, camera)
    across = np.cross(line.direction, line.ray)
    if np.linalg.norm(across) < 0.1 * np.linalg.norm(line.direction):
        # It points along the ray: any side is as good as another.
        across = np.cross(np.eye(3)[np.abs(line.ray).argmin()], line.ray)
    across /= np.linalg.norm(across)
    for side in range(config.sides):
        turn = 2.0 * np.pi * side / config.sides
        axis = np.cos(turn) * across + np.sin(turn) * line.ray
        yield turned(limb, anchors, poses, line.base, np.radians(config.angle_deg) * axis)
