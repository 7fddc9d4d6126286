"""Rigid groups of one frame: carried over, grown from its matches, refined while it is optimized."""

import dataclasses

import numpy as np
import torch

from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import RigidPairs
from animator.pnp import PnPOptions, solve_pnp
from animator.rigid.growing import GrowingConfig, carry_groups, grow_groups
from animator.rigid.refinement import GroupRefiner, RefinementConfig
from animator.types import GaussianMatches, Gaussians, RigidGroups

_PNP_OPTIONS = PnPOptions(iterations=100)
"""A seed on a joint has no pose to find; it must fail fast."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RigidStageConfig:
    """How rigid groups come and go."""

    use_growing: bool = True
    """Start groups by PnP region growing (off: `--no-region-growing`)."""
    use_refinement: bool = True
    """Refine groups inside the optimization (off: `--no-refinement`)."""
    grow_after: float = 0.05
    """Median motion of the matches from rest [object sizes] below which everything still looks rigid
    and no group is grown."""
    pnp_threshold: float = 0.01
    """PnP-RANSAC reprojection threshold [object sizes]."""
    refine_at: tuple[int, ...] = (0, 10)
    """Steps of the image stage, counted from where its loss no longer falls, before which groups are
    refined: while a motion is under way, what moves together is not yet told from what lags together."""
    pairs: int = 4096
    """Pairs of Gaussians that Eq. 4 is averaged over."""
    growing: GrowingConfig = dataclasses.field(default_factory=GrowingConfig)
    refinement: RefinementConfig = dataclasses.field(default_factory=RefinementConfig)


class RigidStage:
    """Keeps the rigid groups of one clip."""

    def __init__(self, rest: Gaussians, config: RigidStageConfig, seed: int) -> None:
        self.config = config
        self._diagonal = rest.diagonal
        self._rest_means = rest.means.detach().cpu().numpy().astype(np.float64)
        rng = np.random.default_rng(seed)
        self._refiner = GroupRefiner(rest, self._diagonal, config.refinement, rng)

    def begin(
        self,
        groups: RigidGroups,
        matches: GaussianMatches | None,
        target: FrameTarget,
        rng: np.random.Generator,
    ) -> "FrameGroups":
        """Update the groups from a frame's matches, before its image stage."""
        if matches is not None:
            groups = self._match(groups, matches, target, rng)
        refine_steps = self.config.refine_at if self.config.use_refinement else ()
        return FrameGroups(
            self._refiner, self._refiner.adopt(groups), self.config.pairs, refine_steps, rng
        )

    def _match(
        self,
        groups: RigidGroups,
        matches: GaussianMatches,
        target: FrameTarget,
        rng: np.random.Generator,
    ) -> RigidGroups:
        config = self.config

        def find_inliers(points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
            threshold_px = config.pnp_threshold * target.object_px
            found = solve_pnp(
                points, pixels, target.camera, threshold_px=threshold_px, options=_PNP_OPTIONS
            )
            return found.inliers

        seen = (matches, self._rest_means)
        groups = carry_groups(groups, *seen, find_inliers, config.growing)
        rest_px, _ = target.camera.project(self._rest_means[matches.gaussian_ids])
        moved_px = np.median(np.linalg.norm(rest_px - matches.target_px, axis=1))
        if config.use_growing and moved_px > config.grow_after * target.object_px:
            groups = grow_groups(groups, *seen, self._diagonal, find_inliers, config.growing, rng)
        return groups


class FrameGroups:
    """Supplies the pairs of Eq. 4 to one image stage and refines the groups on the way."""

    def __init__(
        self,
        refiner: GroupRefiner,
        probe_labels: np.ndarray,
        pair_count: int,
        refine_steps: tuple[int, ...],
        rng: np.random.Generator,
    ) -> None:
        self._refiner = refiner
        self._probe_labels = probe_labels
        self._pair_count = pair_count
        self._refine_steps = refine_steps
        self._rng = rng
        self._pairs = self._sample()

    @property
    def groups(self) -> RigidGroups:
        """The groups as refined so far, over all Gaussians."""
        return self._refiner.spread(self._probe_labels)

    def __call__(self, settled_steps: int, posed: Gaussians) -> RigidPairs | None:
        """Return the pairs for a step; refine first where it is time (Algorithm 2)."""
        if settled_steps in self._refine_steps:
            self._probe_labels = self._refiner.refine(self._probe_labels, posed, self._rng)
            self._pairs = self._sample()
        return self._pairs

    def _sample(self) -> RigidPairs | None:
        first, second = self._refiner.sample_pairs(self._probe_labels, self._pair_count, self._rng)
        if len(first) == 0:
            return None
        return RigidPairs(first=torch.from_numpy(first), second=torch.from_numpy(second))
