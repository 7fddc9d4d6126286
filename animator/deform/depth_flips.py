"""Limbs turned over in depth: the other pose of a limb that one image can hardly tell.

A limb that leans toward the camera looks almost like one that leans away by as much (the Necker reversal), and a
descent that took the wrong one does not come back by itself. So a solved pose has neighbors to be tried, each with
one limb mirrored in depth about where it begins: the "kinematic jumps" of Sminchisescu and Triggs (Kinematic Jump
Processes for Monocular 3D Human Tracking, CVPR 2003), for limbs that nobody named.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np

from animator.deform.limbs import Limb, line_of, turned
from animator.types import AnchorPoses, Anchors, Camera


@dataclasses.dataclass(frozen=True, kw_only=True)
class FlipConfig:
    """Which limbs there are, and which of them lean."""

    lengths: tuple[float, ...] = (0.3, 0.45, 0.6, 0.75)
    """Lengths of a limb [share of the way from its tip to the middle of the object], the shortest first."""
    least_slope: float = 0.25
    """Share of a limb's length that runs along the viewing ray, below which both poses are the same."""


def flipped_poses(
    anchors: Anchors,
    poses: AnchorPoses,
    camera: Camera,
    limbs: list[Limb],
    config: FlipConfig,
) -> Iterator[tuple[Limb, AnchorPoses]]:
    """Turn one limb after the other over in depth.

    The direction u of a limb, from its base to its middle, is mirrored at the plane across the viewing ray; the limb
    follows by the smallest rotation about its base that does so. It stays what it is, only turned.

    Args:
        anchors: The anchors at rest.
        poses: The pose to flip limbs of.
        camera: Sees it.
        limbs: The limbs.
        config: Which of them lean.

    Yields:
        Each limb that leans, with the pose in which it is turned over.
    """
    for limb in limbs:
        line = line_of(limb, anchors, poses, camera)
        depth = float(line.direction @ line.ray)
        length = float(np.linalg.norm(line.direction))
        if abs(depth) < config.least_slope * length:
            continue
        axis = np.cross(line.direction, -np.sign(depth) * line.ray)
        if np.linalg.norm(axis) < 1e-6 * length:
            continue
        # The angle between the direction and its mirror image.
        angle = 2.0 * np.arcsin(min(abs(depth) / length, 1.0))
        rotvec = angle * axis / np.linalg.norm(axis)
        yield limb, turned(limb, anchors, poses, line.base, rotvec)
