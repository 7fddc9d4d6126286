import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator import quaternions
from animator.rigid.refinement import GroupRefiner, RefinementConfig, rigidity_scores
from animator.types import Gaussians, RigidGroups
from tests.helpers.objects import box_points, gaussians_at


def hinged(angle_deg: float) -> tuple[Gaussians, Gaussians, np.ndarray]:
    """A bar whose right half turned about z; rest rotations are arbitrary."""
    points = box_points((0, 0, 0), (1.6, 0.4, 0.4), 900, 0)
    rest = gaussians_at(points)
    generator = torch.Generator().manual_seed(0)
    turned_rest = quaternions.normalize(torch.randn(len(rest), 4, generator=generator))
    rest = rest.posed(rest.means, turned_rest)
    rotation = Rotation.from_euler("z", angle_deg, degrees=True)
    right = points[:, 0] > 0
    quat = torch.tensor(rotation.as_quat(scalar_first=True), dtype=torch.float32)
    quats = torch.where(
        torch.from_numpy(right)[:, None],
        quaternions.multiply(quat.expand(len(rest), 4), rest.quats_wxyz),
        rest.quats_wxyz,
    )
    moved = np.where(right[:, None], points @ rotation.as_matrix().T, points)
    return rest, rest.posed(torch.as_tensor(moved, dtype=torch.float32), quats), right


def test_scores_of_a_hinge():
    rest, posed, right = hinged(30)
    members = np.flatnonzero(right)[:50]
    scores = rigidity_scores(np.arange(len(rest)), members, rest, posed)
    assert scores[right].max() < 1e-9
    # A left Gaussian sees the right ones turn: |(R - I) mu_j|^2 averaged over the members' x and y.
    flat = rest.means.numpy()[members, :2]
    expected = np.mean((2 * np.sin(np.radians(15))) ** 2 * (flat**2).sum(axis=1))
    np.testing.assert_allclose(scores[~right], expected, rtol=1e-3)


def test_refinement_spreads_a_seed_over_its_part_and_no_further():
    rest, posed, right = hinged(30)
    refiner = GroupRefiner(rest, rest.diagonal, RefinementConfig(), np.random.default_rng(0))
    x = rest.means.numpy()[:, 0]
    labels = np.full(len(rest), -1)
    labels[(x > 0.5) & (x < 0.7)] = 0
    labels[(x < -0.5) & (x > -0.7)] = 1
    probes = refiner.adopt(RigidGroups(labels=labels))
    rng = np.random.default_rng(1)
    for _ in range(15):
        probes = refiner.refine(probes, posed, rng)
    found = refiner.spread(probes).labels
    assert np.mean(found[right] == found[x > 0.6][0]) > 0.97
    assert np.mean(found[~right] == found[x < -0.6][0]) > 0.97
    assert found[x > 0.6][0] != found[x < -0.6][0]


def test_members_that_leave_are_dropped():
    rest, posed, right = hinged(30)
    refiner = GroupRefiner(rest, rest.diagonal, RefinementConfig(), np.random.default_rng(0))
    x = rest.means.numpy()[:, 0]
    wrong = RigidGroups(labels=np.where(right | (x > -0.15), 0, -1))
    probes = refiner.adopt(wrong)
    for _ in range(3):
        probes = refiner.refine(probes, posed, np.random.default_rng(2))
    found = refiner.spread(probes).labels
    assert np.mean(found[x > 0.2] >= 0) > 0.95
    assert np.mean(found[(x < -0.08)] >= 0) < 0.1


def test_pairs_stay_within_groups():
    rest, _, right = hinged(30)
    refiner = GroupRefiner(rest, rest.diagonal, RefinementConfig(), np.random.default_rng(0))
    labels = np.where(right, 0, 1)
    first, second = refiner.sample_pairs(
        refiner.adopt(RigidGroups(labels=labels)), 500, np.random.default_rng(3)
    )
    assert len(first) > 400
    assert np.all(labels[first] == labels[second])
    assert np.all(first != second)


@pytest.mark.parametrize("probes", [900, 300])
def test_adopt_and_spread_are_inverse_where_probes_suffice(probes):
    rest, _, right = hinged(30)
    config = RefinementConfig(probes=probes)
    refiner = GroupRefiner(rest, rest.diagonal, config, np.random.default_rng(0))
    labels = np.where(right, 0, 1)
    back = refiner.spread(refiner.adopt(RigidGroups(labels=labels))).labels
    assert np.mean(back == labels) > (0.999 if probes == 900 else 0.93)
    assert refiner.spread(np.full(probes, -1)).count == 0
