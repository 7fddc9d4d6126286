import numpy as np
import pytest
import torch
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from animator.deform.anchors import build_anchors, with_sharper_skin
from tests.helpers.objects import box_points, gaussians_at
from tests.helpers.textured import textured_box


@pytest.fixture(scope="module")
def two_bars():
    """Two parallel bars, close to each other but joined only at the far left end (a hairpin)."""
    top = box_points((0.0, 0.06, 0.0), (2.0, 0.05, 0.05), 1500, 1)
    bottom = box_points((0.0, -0.06, 0.0), (2.0, 0.05, 0.05), 1500, 2)
    bend = box_points((-1.0, 0.0, 0.0), (0.05, 0.17, 0.05), 300, 3)
    return gaussians_at(np.concatenate([top, bottom, bend]))


def test_weights_are_a_partition_of_unity_over_distinct_anchors(two_bars):
    anchors = build_anchors(two_bars, target_count=40)
    weights, ids = anchors.skin_weights, anchors.skin_ids
    assert torch.all(weights >= 0)
    torch.testing.assert_close(weights.sum(dim=1), torch.ones(len(two_bars)))
    for row_ids, row_weights in zip(ids[::37], weights[::37], strict=True):
        used = row_ids[row_weights > 0].tolist()
        assert len(used) == len(set(used))
    assert int(ids.max()) < len(anchors)


def test_weights_run_along_the_object_and_not_across_a_gap(two_bars):
    anchors = build_anchors(two_bars, target_count=40)
    means = two_bars.means
    at_tip = (means[:, 0] > 0.6) & (means[:, 1] > 0)
    followed = anchors.positions[anchors.skin_ids[at_tip].long()]
    across = (followed[..., 1] < 0).float() * anchors.skin_weights[at_tip]
    assert float(across.sum() / at_tip.sum()) < 0.01


def test_a_sharper_skin_has_a_shorter_reach(two_bars):
    anchors = build_anchors(two_bars, target_count=40)
    sharp = with_sharper_skin(anchors, 4.0)
    weights = sharp.skin_weights
    torch.testing.assert_close(weights.sum(dim=1), torch.ones(len(two_bars)))
    # exp(-d^2 / 2 h^2) at half the reach h: logarithms of ratios are four times as large.
    ratios, were = (torch.log(w[:, 0] / w[:, 1]) for w in (weights, anchors.skin_weights))
    is_shared = anchors.skin_weights[:, 1] > 1e-3
    torch.testing.assert_close(ratios[is_shared], 4.0 * were[is_shared], rtol=1e-3, atol=1e-4)
    assert torch.equal(sharp.skin_ids, anchors.skin_ids)
    assert torch.equal(sharp.edges, anchors.edges)


def test_graph_is_connected_and_symmetric_even_for_separate_pieces():
    pieces = [box_points((x, 0.0, 0.0), (0.5, 0.5, 0.5), 400, i) for i, x in enumerate((0, 3, 9))]
    anchors = build_anchors(gaussians_at(np.concatenate(pieces)), target_count=30)
    edges = anchors.edges.numpy()
    count = len(anchors)
    adjacency = coo_matrix((np.ones(len(edges)), edges.T), (count, count))
    assert connected_components(adjacency, directed=False)[0] == 1
    assert {tuple(e) for e in edges} == {tuple(e[::-1]) for e in edges}
    assert float(anchors.edge_weights.mean()) == pytest.approx(1.0, rel=1e-4)


def test_anchor_count_is_near_the_wish_and_faint_gaussians_shape_nothing(two_bars):
    assert 20 <= len(build_anchors(two_bars, target_count=40)) <= 60
    points = box_points((0, 0, 0), (1, 1, 1), 800, 5)
    haze = box_points((40, 0, 0), (1, 1, 1), 200, 6)
    gaussians = gaussians_at(np.concatenate([points, haze]))
    gaussians.opacities[800:] = 0.01
    anchors = build_anchors(gaussians, target_count=30)
    assert float(anchors.positions[:, 0].max()) < 1.0
    assert gaussians.diagonal == pytest.approx(np.sqrt(3), rel=0.05)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_handful_of_gaussians_still_gets_anchors(count):
    anchors = build_anchors(
        gaussians_at(box_points((0, 0, 0), (1, 1, 1), count, 7)), target_count=50
    )
    assert len(anchors) >= 1
    torch.testing.assert_close(anchors.skin_weights.sum(dim=1), torch.ones(count))


def test_values_of_gaussians_are_averaged_over_the_anchors_that_carry_them():
    box = textured_box()
    anchors = build_anchors(box, target_count=30)
    places = np.stack([anchors.mean_of_carried(axis) for axis in box.means.numpy().T], axis=1)
    assert np.abs(places - anchors.positions.numpy()).max() < 1.5 * anchors.spacing
    np.testing.assert_allclose(anchors.mean_of_carried(np.full(len(box), 0.3)), 0.3, rtol=1e-6)
