"""Rigid part initialization: region growing with PnP-RANSAC (paper Sec. 3.3, supplement Algorithm 1)."""

import dataclasses
from collections.abc import Callable

import numpy as np
from scipy.spatial import KDTree

from animator.types import GaussianMatches, RigidGroups

FindInliers = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""PnP-RANSAC: rest points (M, 3) and pixels (M, 2) -> bool inliers (M,); all False on failure."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class GrowingConfig:
    """Limits of the region growing."""

    radius: float = 0.05
    """Ball-query radius [diagonals]."""
    min_members: int = 20
    """Groups with fewer matched Gaussians are dropped."""
    min_inlier_share: float = 0.7
    """A seed's first ball, or a carried group, with fewer inliers is not rigid."""
    max_matches: int = 1200
    """Matches are thinned to this many before growing."""
    max_rounds: int = 40
    """Most expansions of one group."""


def carry_groups(
    groups: RigidGroups,
    matches: GaussianMatches,
    rest_means: np.ndarray,
    find_inliers: FindInliers,
    config: GrowingConfig,
) -> RigidGroups:
    """Keep the groups of the last frame that still move as one; members seen to leave are dropped.

    Args:
        groups: Groups so far.
        matches: Where Gaussians are seen in the new frame.
        rest_means: Rest centres of all Gaussians [scene unit], shape (N, 3).
        find_inliers: PnP-RANSAC with the frame's camera.
        config: Limits.

    Returns:
        Groups with the same numbers; a group that broke up loses all its members.
    """
    labels = groups.labels.copy()
    matched_labels = labels[matches.gaussian_ids]
    for label in range(groups.count):
        members = np.flatnonzero(matched_labels == label)
        if len(members) < config.min_members:
            continue
        ids = matches.gaussian_ids[members]
        inliers = find_inliers(rest_means[ids], matches.target_px[members])
        if inliers.mean() < config.min_inlier_share:
            labels[labels == label] = -1
        else:
            labels[ids[~inliers]] = -1
    return RigidGroups(labels=labels)


def grow_groups(
    groups: RigidGroups,
    matches: GaussianMatches,
    rest_means: np.ndarray,
    diagonal: float,
    find_inliers: FindInliers,
    config: GrowingConfig,
    rng: np.random.Generator,
) -> RigidGroups:
    """Grow new rigid groups among the matched Gaussians that have none (Algorithm 1).

    Args:
        groups: Groups so far; kept.
        matches: Gaussian-to-pixel matches of the frame.
        rest_means: Rest centres of all Gaussians [scene unit], shape (N, 3).
        diagonal: The object's diagonal [scene unit].
        find_inliers: PnP-RANSAC with the frame's camera.
        config: Limits.
        rng: Chooses the seeds.

    Returns:
        The groups with the new ones appended.
    """
    labels = groups.labels.copy()
    free = np.flatnonzero(labels[matches.gaussian_ids] < 0)
    if len(free) > config.max_matches:
        free = np.sort(rng.choice(free, config.max_matches, replace=False))
    if len(free) == 0:
        return groups
    ids, pixels = matches.gaussian_ids[free], matches.target_px[free]
    points = rest_means[ids]
    neighbors = KDTree(points).query_ball_point(points, config.radius * diagonal)
    unlabeled = np.ones(len(free), bool)
    next_label = groups.count
    for seed in rng.permutation(len(free)):
        if not unlabeled[seed]:
            continue
        group, tried = _grow_from(seed, unlabeled, neighbors, points, pixels, find_inliers, config)
        unlabeled[tried] = False
        if len(group) >= config.min_members:
            labels[ids[group]] = next_label
            next_label += 1
    return RigidGroups(labels=labels)


def _grow_from(
    seed: int,
    unlabeled: np.ndarray,
    neighbors: np.ndarray,
    points: np.ndarray,
    pixels: np.ndarray,
    find_inliers: FindInliers,
    config: GrowingConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """Expand by ball query and keep the PnP inliers until the group stops growing.

    Returns:
        The members, and every candidate of the last expansion (both leave the pool, as in Algorithm 1).
    """
    group = np.array([seed])
    candidates = group
    for round_number in range(config.max_rounds):
        reached = np.unique(np.concatenate([neighbors[i] for i in group]).astype(np.int64))
        candidates = np.union1d(reached[unlabeled[reached]], group)
        inliers = find_inliers(points[candidates], pixels[candidates])
        if round_number == 0 and inliers.mean() < config.min_inlier_share:
            return np.array([], np.int64), group
        if inliers.sum() <= len(group):
            break
        group = candidates[inliers]
    return group, candidates
