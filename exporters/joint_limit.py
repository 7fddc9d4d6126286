"""Fewer joints, for engines that index them with eight bits: those that matter least are merged.

The best joints come from fitting with fewer anchors; this is for a clip that is there already.
"""

import dataclasses
import logging

import numpy as np

from exporters.clip import Clip, Rig, Skin, Tracks, Uncertainty

MEASURED_KEYS = 64
"""Most keys, evenly spread, at which joints are compared and the error is measured."""

_log = logging.getLogger(__name__)


def within_limit(clip: Clip, joint_limit: int | None) -> Clip:
    """Return a clip of at most so many joints; itself, if it has no more.

    Joints without children are merged, those first whose Gaussians, by weight, move least when they
    follow another joint; each into the joint that takes them nearest. The log says what it costs.

    Args:
        clip: A valid clip.
        joint_limit: Most joints, 1 or more; None for any number.
    """
    if joint_limit is None or len(clip.rig) <= joint_limit:
        return clip
    times_s = _measured_times(clip.tracks)
    merged = clip
    while len(merged.rig) > joint_limit:
        merged = _merged(merged, times_s, len(merged.rig) - joint_limit)
    _log.warning(
        "%s: %d joints merged into %d; no Gaussian moves by more than %.2g %% of the diagonal for "
        "it. For a better rig, fit again with fewer (animate --anchors %d, half as many if it moves "
        "smoothly)",
        clip.name,
        len(clip.rig),
        len(merged.rig),
        100 * _largest_error(clip, merged, times_s),
        joint_limit - 1,
    )
    return merged


def _measured_times(tracks: Tracks) -> np.ndarray:
    count = min(len(tracks), MEASURED_KEYS)
    return tracks.times_s[np.linspace(0, len(tracks) - 1, count).round().astype(int)]


def _merged(clip: Clip, times_s: np.ndarray, wanted: int) -> Clip:
    """Merge up to so many of the present leaves of the tree, the cheapest one first each time."""
    leaves = np.setdiff1d(np.arange(1, len(clip.rig)), clip.rig.parents)
    distances = _distances(clip, leaves, times_s)
    weights = _total_weights(clip.skin, len(clip.rig))
    targets = np.arange(len(clip.rig))
    is_left = np.ones(len(leaves), bool)
    for _ in range(min(wanted, len(leaves))):
        costs = np.where(is_left, distances.min(axis=1), np.inf)
        costs[is_left] *= weights[leaves[is_left]]
        row = int(np.argmin(costs))
        leaf, target = leaves[row], np.argmin(distances[row])
        weights[target] += weights[leaf]
        targets[targets == leaf] = target
        distances[:, leaf] = np.inf
        is_left[row] = False
    return _without(clip, leaves[~is_left], targets)


def _distances(clip: Clip, leaves: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Return how far each leaf's Gaussians part from it, at most, if they follow each other joint.

    Taken at the weighted mean of the leaf's Gaussians [scene unit], inf for itself, shape (L, J).
    """
    inverse_binds = np.linalg.inv(clip.bind_matrices())
    affine = np.stack([(clip.joint_matrices_at(t) @ inverse_binds)[:, :3] for t in times_s])
    distances = np.empty((len(leaves), len(clip.rig)))
    for row, (leaf, center) in enumerate(zip(leaves, _centers(clip)[leaves], strict=True)):
        places = affine[..., :3] @ center + affine[..., 3]
        distances[row] = np.linalg.norm(places - places[:, leaf : leaf + 1], axis=-1).max(axis=0)
        distances[row, leaf] = np.inf
    return distances


def _centers(clip: Clip) -> np.ndarray:
    """Return the weighted mean of each joint's Gaussians, 0 where it has none, shape (J, 3)."""
    sums = np.zeros((len(clip.rig), 3))
    weighted = clip.skin.weights[..., None] * clip.splats.positions[:, None].astype(np.float64)
    np.add.at(sums, clip.skin.joint_ids, weighted)
    return sums / np.maximum(_total_weights(clip.skin, len(clip.rig)), 1e-30)[:, None]


def _total_weights(skin: Skin, joint_count: int) -> np.ndarray:
    return np.bincount(skin.joint_ids.ravel(), skin.weights.ravel(), minlength=joint_count)


def _without(clip: Clip, removed: np.ndarray, targets: np.ndarray) -> Clip:
    """Leave joints out; what followed joint j follows `targets[j]`."""
    rig, tracks = clip.rig, clip.tracks
    kept = np.setdiff1d(np.arange(len(rig)), removed)
    new_ids = np.zeros(len(rig), np.int32)
    new_ids[kept] = np.arange(len(kept))
    parents = rig.parents[kept]
    uncertainty = clip.uncertainty
    if uncertainty is not None:
        uncertainty = Uncertainty(
            along_ray=uncertainty.along_ray[:, kept], across_ray=uncertainty.across_ray[:, kept]
        )
    return dataclasses.replace(
        clip,
        rig=Rig(
            joint_names=tuple(rig.joint_names[joint] for joint in kept),
            parents=np.where(parents < 0, -1, new_ids[parents]),
            rest_translations=rig.rest_translations[kept],
            rest_quats_wxyz=rig.rest_quats_wxyz[kept],
            part_ids=rig.part_ids[kept],
        ),
        skin=_summed(new_ids[targets[clip.skin.joint_ids]], clip.skin.weights),
        tracks=dataclasses.replace(
            tracks,
            translations=tracks.translations[:, kept],
            quats_wxyz=tracks.quats_wxyz[:, kept],
        ),
        uncertainty=uncertainty,
    )


def _summed(joint_ids: np.ndarray, weights: np.ndarray) -> Skin:
    """Add the weights of a joint that occurs twice in a row; the second influence becomes unused."""
    weights = weights.copy()
    influences = joint_ids.shape[1]
    for first in range(influences):
        for second in range(first + 1, influences):
            is_same = joint_ids[:, first] == joint_ids[:, second]
            weights[:, first] += np.where(is_same, weights[:, second], 0)
            weights[is_same, second] = 0
    return Skin(joint_ids=np.where(weights > 0, joint_ids, 0), weights=weights)


def _largest_error(clip: Clip, merged: Clip, times_s: np.ndarray) -> float:
    """Return how far a Gaussian is moved at most, as a share of the diagonal."""
    diagonal = float(np.linalg.norm(np.ptp(clip.splats.positions, axis=0)))
    largest = 0.0
    for time_s in times_s:
        moved = merged.pose_at(time_s).positions - clip.pose_at(time_s).positions
        largest = max(largest, float(np.linalg.norm(moved, axis=1).max()))
    return largest / diagonal if diagonal > 0 else 0.0
