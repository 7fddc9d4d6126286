"""Limbs turned over in depth: the other pose of a limb that one image can hardly tell.

A limb that leans toward the camera looks almost like one that leans away by as much (the Necker reversal), and a
descent that took the wrong one does not come back by itself. So a solved pose has neighbors to be tried, each with
one limb mirrored in depth about where it begins: the "kinematic jumps" of Sminchisescu and Triggs (Kinematic Jump
Processes for Monocular 3D Human Tracking, CVPR 2003), for limbs that nobody named.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import distances_between
from animator.types import AnchorPoses, Anchors, Camera


@dataclasses.dataclass(frozen=True, kw_only=True)
class FlipConfig:
    """Which limbs there are, and which of them lean."""

    lengths: tuple[float, ...] = (0.3, 0.45, 0.6, 0.75)
    """Lengths of a limb [share of the way from its tip to the middle of the object]."""
    least_slope: float = 0.25
    """Share of a limb's length that runs along the viewing ray, below which both poses are the same."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Limb:
    """The anchors near a tip of the object."""

    tip: int
    """Index of the anchor at its end."""
    shares: np.ndarray
    """How far each anchor belongs to it, 0..1, falling over one spacing, shape (A,)."""
    base: np.ndarray
    """Indices of the anchors around the place where it begins, shape (B,)."""


def find_limbs(anchors: Anchors, config: FlipConfig) -> list[Limb]:
    """Find limbs of some lengths at each tip, an anchor that is farther from the middle than its neighbors.

    Returns:
        The limbs, tip by tip, the shortest of each first.
    """
    along = distances_between(anchors)
    from_middle = along[along.sum(axis=1).argmin()]
    first, second = anchors.edges.cpu().numpy().T
    is_tip = np.ones(len(anchors), bool)
    np.logical_and.at(is_tip, first, from_middle[first] >= from_middle[second])

    limbs = []
    for tip in np.flatnonzero(is_tip):
        for length in config.lengths:
            beyond = along[tip] - length * from_middle[tip]
            base = np.flatnonzero((beyond >= 0) & (beyond < 1.2 * anchors.spacing))
            # Two anchors at least: one alone has no direction.
            if (beyond < 0).sum() >= 2 and len(base):
                shares = np.clip(0.5 - beyond / anchors.spacing, 0, 1)
                limbs.append(Limb(tip=int(tip), shares=shares, base=base))
    return limbs


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
    rest = anchors.positions.detach().cpu().numpy().astype(np.float64)
    places = rest + poses.translations.detach().cpu().numpy()
    turns = Rotation.from_quat(poses.quats_wxyz.detach().cpu().numpy(), scalar_first=True)
    for limb in limbs:
        base = places[limb.base].mean(axis=0)
        middle = np.average(places, axis=0, weights=limb.shares)
        direction = middle - base
        ray = (middle - camera.position) / np.linalg.norm(middle - camera.position)
        depth, length = float(direction @ ray), float(np.linalg.norm(direction))
        if abs(depth) < config.least_slope * length:
            continue
        axis = np.cross(direction, -np.sign(depth) * ray)
        if np.linalg.norm(axis) < 1e-6 * length:
            continue
        # The angle between the direction and its mirror image.
        angle = 2.0 * np.arcsin(min(abs(depth) / length, 1.0))
        rotvec = angle * axis / np.linalg.norm(axis)
        flip = Rotation.from_rotvec(limb.shares[:, None] * rotvec)
        moved = np.where(
            limb.shares[:, None] > 0, base + flip.apply(places - base) - rest, places - rest
        )
        quats_wxyz = torch.as_tensor((flip * turns).as_quat(scalar_first=True))
        flipped = AnchorPoses(
            quats_wxyz=quats_wxyz.to(poses.quats_wxyz),
            translations=torch.as_tensor(moved).to(poses.translations),
        )
        yield limb, flipped
