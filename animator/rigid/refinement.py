"""Rigid part refinement inside the optimization (paper Sec. 3.3 and Eq. 1, supplement Algorithm 2)."""

import dataclasses

import numpy as np
import torch
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from animator import quaternions
from animator.types import Gaussians, RigidGroups


@dataclasses.dataclass(frozen=True, kw_only=True)
class RefinementConfig:
    """Thresholds of the refinement, as lengths in diagonals (Eq. 1 compares their squares)."""

    radius: float = 0.05
    """Ball-query radius of an expansion."""
    join_below: float = 0.008
    """tau_low: a candidate that deviates less joins the group."""
    leave_above: float = 0.02
    """tau_high: a member that deviates more leaves."""
    min_members: int = 8
    """Smaller groups dissolve."""
    probes: int = 3000
    """Gaussians that take part; the others follow their nearest probe."""
    sampled_members: int = 64
    """Members a candidate is compared with."""


def rigidity_scores(
    candidates: np.ndarray, members: np.ndarray, rest: Gaussians, posed: Gaussians
) -> np.ndarray:
    """Mean squared deviation of candidates from a group's rigid motion (Eq. 1) [scene unit squared].

    Args:
        candidates: Gaussian indices i, shape (C,).
        members: Gaussian indices j of the group, shape (S,).
        rest: The rest pose.
        posed: The current pose.

    Returns:
        S_rigid(mu_i, G) for each candidate, shape (C,).
    """
    turns = quaternions.multiply(
        posed.quats_wxyz[candidates], quaternions.conjugate(rest.quats_wxyz[candidates])
    )
    rest_offsets = rest.means[candidates][:, None] - rest.means[members][None]
    posed_offsets = posed.means[candidates][:, None] - posed.means[members][None]
    # |R_i^-1 d - R'_i^-1 d'| = |(R'_i R_i^-1) d - d'|
    rotated = torch.einsum("cij,cmj->cmi", quaternions.to_matrices(turns), rest_offsets)
    return (rotated - posed_offsets).square().sum(dim=-1).mean(dim=1).cpu().numpy()


class GroupRefiner:
    """Grows and trims rigid groups of one clip; holds the rest pose's neighborhoods."""

    def __init__(
        self, rest: Gaussians, diagonal: float, config: RefinementConfig, rng: np.random.Generator
    ) -> None:
        self._rest = rest
        self._diagonal = diagonal
        self._config = config
        count = len(rest)
        chosen = rng.choice(count, min(config.probes, count), replace=False)
        self._probes = np.sort(chosen)
        means = rest.means.detach().cpu().numpy()
        tree = KDTree(means[self._probes])
        self._nearest_probe = np.asarray(tree.query(means)[1])
        pairs = tree.query_pairs(config.radius * diagonal, output_type="ndarray")
        rows = np.concatenate([pairs[:, 0], pairs[:, 1]])
        columns = np.concatenate([pairs[:, 1], pairs[:, 0]])
        size = len(self._probes)
        self._adjacent = csr_matrix((np.ones(len(rows), np.float32), (rows, columns)), (size, size))

    def adopt(self, groups: RigidGroups) -> np.ndarray:
        """Read the groups at the probes: each takes the label most of the Gaussians around it have."""
        labeled = groups.labels >= 0
        labels = np.full(len(self._probes), -1, np.int64)
        if labeled.any():
            votes = np.zeros((len(self._probes), groups.count), np.int32)
            np.add.at(votes, (self._nearest_probe[labeled], groups.labels[labeled]), 1)
            voted = votes.sum(axis=1) > 0
            labels[voted] = votes[voted].argmax(axis=1)
        return labels

    def spread(self, probe_labels: np.ndarray) -> RigidGroups:
        """Give every Gaussian the label of its nearest probe; groups are renumbered without gaps."""
        used = np.unique(probe_labels[probe_labels >= 0])
        renumbered = np.full(len(probe_labels), -1, np.int64)
        for new, old in enumerate(used):
            renumbered[probe_labels == old] = new
        return RigidGroups(labels=renumbered[self._nearest_probe])

    def refine(
        self, probe_labels: np.ndarray, posed: Gaussians, rng: np.random.Generator
    ) -> np.ndarray:
        """Run Algorithm 2 once over all groups, largest first.

        Args:
            probe_labels: Group of each probe, -1 for none, shape (P,).
            posed: The current pose, without gradients.
            rng: Samples the members that stand for a group.

        Returns:
            The new labels, shape (P,).
        """
        config = self._config
        labels = probe_labels.copy()
        low = (config.join_below * self._diagonal) ** 2
        high = (config.leave_above * self._diagonal) ** 2
        best_scores = np.full(len(labels), np.inf)
        order = np.argsort(-np.bincount(labels[labels >= 0])) if (labels >= 0).any() else []
        for label in order:
            members = np.flatnonzero(labels == label)
            if len(members) < config.min_members:
                labels[members] = -1
                continue
            sample = members
            if len(sample) > config.sampled_members:
                sample = rng.choice(members, config.sampled_members, replace=False)
            is_member = (labels == label).astype(np.float32)
            candidates = np.flatnonzero((self._adjacent @ is_member > 0) | (is_member > 0))
            scores = rigidity_scores(
                self._probes[candidates], self._probes[sample], self._rest, posed
            )
            joins = (scores < low) & (scores < best_scores[candidates])
            leaves = (labels[candidates] == label) & (scores > high)
            labels[candidates[joins]] = label
            best_scores[candidates[joins]] = scores[joins]
            labels[candidates[leaves]] = -1
        return labels

    def sample_pairs(
        self, probe_labels: np.ndarray, count: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Draw pairs of Gaussians within groups, groups weighted by their size. Shapes (P,), (P,)."""
        labeled = np.flatnonzero(probe_labels >= 0)
        if len(labeled) == 0:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        by_label = labeled[np.argsort(probe_labels[labeled], kind="stable")]
        sizes = np.bincount(probe_labels[by_label])
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        first = rng.integers(0, len(by_label), count)
        groups = probe_labels[by_label[first]]
        second = starts[groups] + rng.integers(0, 1 << 31, count) % sizes[groups]
        apart = first != second
        return self._probes[by_label[first[apart]]], self._probes[by_label[second[apart]]]
