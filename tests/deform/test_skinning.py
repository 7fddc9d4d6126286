"""The skinning kernel against a float64 torch twin of paper Eq. 2."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from animator.deform.skinning import Skinner, skin
from animator.types import AnchorPoses, Anchors


def _unit(rng: np.random.Generator, count: int) -> torch.Tensor:
    return torch.nn.functional.normalize(torch.from_numpy(rng.normal(size=(count, 4))), dim=1)


def _anchors(rng: np.random.Generator, gaussian_count: int, anchor_count: int) -> Anchors:
    influences = min(4, anchor_count)
    ids = [rng.permutation(anchor_count)[:influences] for _ in range(gaussian_count)]
    weights = rng.dirichlet(np.ones(influences), size=gaussian_count)
    return Anchors(
        positions=torch.from_numpy(rng.normal(size=(anchor_count, 3))).float(),
        spacing=0.1,
        skin_ids=torch.from_numpy(np.reshape(ids, (gaussian_count, influences))).int(),
        skin_weights=torch.from_numpy(weights.reshape(gaussian_count, influences)).float(),
        edges=torch.zeros((0, 2), dtype=torch.int64),
        edge_weights=torch.zeros(0),
    )


def _rotation(quats: torch.Tensor) -> torch.Tensor:
    """Rodrigues' formula, written unlike the kernel: R = I + 2 w [u] + 2 [u]^2."""
    w, x, y, z = quats.unbind(-1)
    zero = torch.zeros_like(w)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(-1, 3, 3)
    return torch.eye(3, dtype=quats.dtype) + 2 * w[:, None, None] * cross + 2 * cross @ cross


def _hamilton(left: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
    scalar = left[:, :1] * right[:, :1] - (left[:, 1:] * right[:, 1:]).sum(1, keepdim=True)
    vector = (
        left[:, :1] * right[:, 1:]
        + right[:, :1] * left[:, 1:]
        + torch.linalg.cross(left[:, 1:], right[:, 1:])
    )
    return torch.cat([scalar, vector], 1)


def _twin(means, quats, anchors, anchor_quats, translations):
    ids, weights = anchors.skin_ids.long(), anchors.skin_weights.double()
    unit = torch.nn.functional.normalize(anchor_quats, dim=1)
    at = anchors.positions.double()[ids]
    offsets = means[:, None] - at
    moved = (_rotation(unit)[ids] @ offsets[..., None])[..., 0] + at + translations[ids]
    gathered = unit[ids]
    signs = torch.where((gathered * gathered[:, :1]).sum(-1) < 0, -1.0, 1.0).detach()
    blend = ((weights * signs)[..., None] * gathered).sum(1)
    return (weights[..., None] * moved).sum(1), _hamilton(
        torch.nn.functional.normalize(blend, dim=1), quats
    )


def _relative(found: torch.Tensor, expected: torch.Tensor) -> float:
    return float(((found.double() - expected).norm() / expected.norm()).detach())


@settings(derandomize=True, max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    gaussian_count=st.integers(1, 60),
    anchor_count=st.integers(1, 9),
    distance=st.sampled_from([0.0, 100.0]),
    signs=st.sampled_from([[1.0], [-1.0, 1.0]]),
)
def test_value_and_gradients_equal_the_float64_twin(
    seed, gaussian_count, anchor_count, distance, signs
):
    rng = np.random.default_rng(seed)
    anchors = _anchors(rng, gaussian_count, anchor_count)
    anchors.positions.add_(distance)
    means = torch.from_numpy(rng.normal(size=(gaussian_count, 3)) + distance).float()
    quats = _unit(rng, gaussian_count).float()
    # Arbitrary hemispheres: the blend must not care which of q and -q an anchor has.
    near = torch.tensor([1.0, 0, 0, 0]) + 0.3 * torch.from_numpy(rng.normal(size=(anchor_count, 4)))
    near *= torch.from_numpy(rng.choice(signs, size=(anchor_count, 1)))
    anchor_quats = near.float().requires_grad_()
    translations = torch.from_numpy(rng.normal(size=(anchor_count, 3))).float().requires_grad_()
    twin_quats = anchor_quats.detach().double().requires_grad_()
    twin_translations = translations.detach().double().requires_grad_()

    found = skin(
        means, quats, anchors, AnchorPoses(quats_wxyz=anchor_quats, translations=translations)
    )
    expected = _twin(means.double(), quats.double(), anchors, twin_quats, twin_translations)
    assert _relative(found[0] - distance, expected[0] - distance) < 2e-5
    assert _relative(found[1], expected[1]) < 1e-6

    upstream = [torch.from_numpy(rng.normal(size=tuple(value.shape))) for value in expected]
    sum((a * b.float()).sum() for a, b in zip(found, upstream, strict=True)).backward()
    sum((a * b).sum() for a, b in zip(expected, upstream, strict=True)).backward()
    assert anchor_quats.grad is not None and translations.grad is not None
    scale = upstream[0].norm() + upstream[1].norm()
    assert (anchor_quats.grad - twin_quats.grad).abs().max() / scale < 2e-5
    assert (translations.grad - twin_translations.grad).abs().max() / scale < 1e-5


def test_rest_pose_moves_nothing():
    rng = np.random.default_rng(0)
    anchors = _anchors(rng, 50, 7)
    means, quats = torch.from_numpy(rng.normal(size=(50, 3))).float(), _unit(rng, 50).float()
    rest = AnchorPoses(
        quats_wxyz=torch.tensor([[1.0, 0, 0, 0]]).repeat(7, 1), translations=torch.zeros(7, 3)
    )
    posed_means, posed_quats = skin(means, quats, anchors, rest)
    torch.testing.assert_close(posed_means, means, rtol=0, atol=1e-6)
    torch.testing.assert_close(posed_quats, quats, rtol=0, atol=1e-6)


def test_one_turned_anchor_carries_its_gaussian_around_itself():
    # A quarter turn about z around (1, 0, 0), then 5 up: (2, 0, 0) is one to the right, goes to the
    # other side of the corner, (1, 1, 5); the Gaussian's own half turn about x is then turned too.
    anchors = Anchors(
        positions=torch.tensor([[1.0, 0, 0]]),
        spacing=1.0,
        skin_ids=torch.zeros((1, 4), dtype=torch.int32),
        skin_weights=torch.tensor([[1.0, 0, 0, 0]]),
        edges=torch.zeros((0, 2), dtype=torch.int64),
        edge_weights=torch.zeros(0),
    )
    half = 0.5**0.5
    turn = AnchorPoses(
        quats_wxyz=torch.tensor([[half, 0, 0, half]]), translations=torch.tensor([[0.0, 0, 5]])
    )
    means, quats = skin(torch.tensor([[2.0, 0, 0]]), torch.tensor([[0.0, 1, 0, 0]]), anchors, turn)
    torch.testing.assert_close(means, torch.tensor([[1.0, 1, 5]]))
    torch.testing.assert_close(quats, torch.tensor([[0.0, half, half, 0]]))


def test_gradients_are_the_same_bytes_on_one_and_two_threads():
    import numba

    rng = np.random.default_rng(3)
    anchors = _anchors(rng, 9000, 12)
    skinner = Skinner(
        anchors, torch.from_numpy(rng.normal(size=(9000, 3))).float(), _unit(rng, 9000).float()
    )
    upstream = torch.from_numpy(rng.normal(size=(9000, 3))).float()
    results = []
    threads = numba.get_num_threads()
    for count in (1, min(2, threads)):
        numba.set_num_threads(count)
        quats = _unit(np.random.default_rng(4), 12).float().requires_grad_()
        means, _ = skinner(AnchorPoses(quats_wxyz=quats, translations=torch.zeros(12, 3)))
        (means * upstream).sum().backward()
        assert quats.grad is not None
        results.append((means.detach().numpy().tobytes(), quats.grad.numpy().tobytes()))
    numba.set_num_threads(threads)
    assert results[0] == results[1]


def test_no_gaussians_give_empty_results_and_zero_gradients():
    anchors = _anchors(np.random.default_rng(0), 0, 3)
    quats = torch.tensor([[1.0, 0, 0, 0]]).repeat(3, 1).requires_grad_()
    means, posed = skin(
        torch.zeros(0, 3),
        torch.zeros(0, 4),
        anchors,
        AnchorPoses(quats_wxyz=quats, translations=torch.zeros(3, 3)),
    )
    (means.sum() + posed.sum()).backward()
    assert means.shape == (0, 3) and posed.shape == (0, 4)
    assert quats.grad is not None and not quats.grad.any()


@pytest.mark.parametrize("bad_id", [-1, 3])
def test_an_influence_outside_the_anchors_is_refused(bad_id):
    anchors = _anchors(np.random.default_rng(0), 5, 3)
    anchors.skin_ids[2, 1] = bad_id
    with pytest.raises(ValueError, match=r"skin_ids: expected values in 0\.\.2, found"):
        Skinner(anchors, torch.zeros(5, 3), torch.ones(5, 4))


def test_weights_of_other_gaussians_are_refused():
    anchors = _anchors(np.random.default_rng(0), 5, 3)
    with pytest.raises(ValueError, match="each of 6 Gaussians"):
        Skinner(anchors, torch.zeros(6, 3), torch.ones(6, 4))
