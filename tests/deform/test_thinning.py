import numpy as np
import pytest
import torch

from animator.deform.anchors import build_anchors
from animator.deform.thinning import thinned
from tests.helpers.objects import box_points, gaussians_at


@pytest.mark.parametrize(("most", "left"), [(1000, 500), (500, 500), (499, 250), (100, 100)])
def test_keeps_at_most_so_many_that_cover_as_much(most, left):
    gaussians = gaussians_at(box_points((0, 0, 0), (1, 1, 1), 500, 0))
    anchors = build_anchors(gaussians, target_count=20)
    few, rig = thinned(gaussians, anchors, most)
    assert len(few) == len(rig.skin_ids) == len(rig.skin_weights) == left
    area = (gaussians.scales**2).sum()
    assert float((few.scales**2).sum() / area) == pytest.approx(1.0, abs=1e-5)


def test_what_is_left_follows_the_anchors_it_followed():
    gaussians = gaussians_at(box_points((0, 0, 0), (1, 1, 1), 500, 0))
    anchors = build_anchors(gaussians, target_count=20)
    few, rig = thinned(gaussians, anchors, 200)
    kept = [int((gaussians.means == mean).all(dim=1).nonzero()) for mean in few.means]
    assert torch.equal(rig.skin_ids, anchors.skin_ids[kept])
    np.testing.assert_array_equal(rig.skin_weights.numpy(), anchors.skin_weights[kept].numpy())
    assert torch.equal(rig.positions, anchors.positions)
