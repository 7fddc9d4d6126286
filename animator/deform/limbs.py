"""Limbs: what hangs on the object by one place, and can turn there."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import distances_between
from animator.types import AnchorPoses, Anchors, Camera


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Limb:
    """The anchors near a tip of the object."""

    tip: int
    """Index of the anchor at its end."""
    shares: np.ndarray
    """How far each anchor belongs to it, 0..1, falling over one spacing, shape (A,)."""
    base: np.ndarray
    """Indices of the anchors around the place where it begins, shape (B,)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class LimbLine:
    """Where a limb is in one pose, and from where it is seen."""

    base: np.ndarray
    """Middle of the place where it begins [scene unit], shape (3,)."""
    direction: np.ndarray
    """From there to its middle [scene unit], shape (3,)."""
    ray: np.ndarray
    """From the camera to its middle, unit, shape (3,)."""


def find_limbs(anchors: Anchors, lengths: Sequence[float]) -> list[Limb]:
    """Find limbs of some lengths at each tip, an anchor that is farther from the middle than its neighbors.

    Args:
        anchors: The anchors at rest.
        lengths: Of the limbs [shares of the way from the tip to the middle of the object].

    Returns:
        The limbs, tip by tip, in the order of the lengths.
    """
    along = distances_between(anchors)
    from_middle = along[along.sum(axis=1).argmin()]
    first, second = anchors.edges.cpu().numpy().T
    is_tip = np.ones(len(anchors), bool)
    np.logical_and.at(is_tip, first, from_middle[first] >= from_middle[second])

    limbs = []
    for tip in np.flatnonzero(is_tip):
        for length in lengths:
            beyond = along[tip] - length * from_middle[tip]
            base = np.flatnonzero((beyond >= 0) & (beyond < 1.2 * anchors.spacing))
            # Two anchors at least: one alone has no direction.
            if (beyond < 0).sum() >= 2 and len(base):
                shares = np.clip(0.5 - beyond / anchors.spacing, 0, 1)
                limbs.append(Limb(tip=int(tip), shares=shares, base=base))
    return limbs


def line_of(limb: Limb, anchors: Anchors, poses: AnchorPoses, camera: Camera) -> LimbLine:
    """Say where a limb is in a pose, and from where a camera sees it."""
    places = _rest_places(anchors) + poses.translations.detach().cpu().numpy()
    base = places[limb.base].mean(axis=0)
    middle = np.average(places, axis=0, weights=limb.shares)
    ray = middle - camera.position
    return LimbLine(base=base, direction=middle - base, ray=ray / np.linalg.norm(ray))


def turned(
    limb: Limb, anchors: Anchors, poses: AnchorPoses, base: np.ndarray, rotvec: np.ndarray
) -> AnchorPoses:
    """Turn a limb as one piece about its base; what belongs to it in part turns in part.

    Args:
        limb: The limb.
        anchors: The anchors at rest.
        poses: The pose to turn it in.
        base: The point that stays [scene unit], shape (3,).
        rotvec: Axis times angle in world space [rad], shape (3,).

    Returns:
        The pose with the limb turned.
    """
    rest = _rest_places(anchors)
    places = rest + poses.translations.detach().cpu().numpy()
    turns = Rotation.from_quat(poses.quats_wxyz.detach().cpu().numpy(), scalar_first=True)
    shares = limb.shares[:, None]
    turn = Rotation.from_rotvec(shares * rotvec)
    moved = np.where(shares > 0, base + turn.apply(places - base), places) - rest
    quats_wxyz = torch.as_tensor((turn * turns).as_quat(scalar_first=True))
    return AnchorPoses(
        quats_wxyz=quats_wxyz.to(poses.quats_wxyz),
        translations=torch.as_tensor(moved).to(poses.translations),
    )


def _rest_places(anchors: Anchors) -> np.ndarray:
    return anchors.positions.detach().cpu().numpy().astype(np.float64)
