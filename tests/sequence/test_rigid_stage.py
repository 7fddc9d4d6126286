"""Groups are refined when a frame's solve has arrived, not on its way."""

import numpy as np

from animator.sequence.rigid_stage import FrameGroups, RigidStageConfig


class CountingRefiner:
    """Adds one to every label at each refinement."""

    def refine(self, labels, posed, rng):
        return labels + 1

    def sample_pairs(self, labels, count, rng):
        return labels[:1], labels[:1]


def test_groups_are_refined_from_where_the_loss_no_longer_falls():
    rng = np.random.default_rng(0)
    config = RigidStageConfig()
    groups = FrameGroups(CountingRefiner(), np.zeros(3, np.int64), 8, config.refine_at, rng)
    refinements = [int(groups(settled_steps, None).first[0]) for settled_steps in range(-30, 25)]
    assert set(refinements[:30]) == {0}
    assert refinements[30] == 1
    assert refinements[-1] == len(config.refine_at)
