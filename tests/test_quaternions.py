import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from animator import quaternions

seeds = st.integers(0, 10_000)


def random_rotations(seed: int) -> Rotation:
    """Uniform rotations, some within 1e-6 of the identity and some within 1e-6 of a half turn."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(30, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.concatenate([rng.uniform(0, np.pi, 20), np.full(5, 1e-6), np.full(5, np.pi - 1e-6)])
    return Rotation.from_rotvec(axes * angles[:, None])


@settings(max_examples=20, derandomize=True, deadline=None)
@given(seeds)
def test_agrees_with_scipy(seed):
    first, second = random_rotations(seed), random_rotations(seed + 1)
    a = torch.from_numpy(first.as_quat(scalar_first=True))
    b = torch.from_numpy(second.as_quat(scalar_first=True))
    vectors = torch.from_numpy(np.random.default_rng(seed).normal(size=(30, 3)))
    matrices = quaternions.to_matrices(a)
    np.testing.assert_allclose(matrices.numpy(), first.as_matrix(), atol=1e-12)
    product = quaternions.to_matrices(quaternions.multiply(a, b)).numpy()
    np.testing.assert_allclose(product, (first * second).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(
        quaternions.rotate(a, vectors).numpy(), first.apply(vectors), atol=1e-12
    )
    back = quaternions.from_matrices(matrices)
    np.testing.assert_allclose(quaternions.to_matrices(back).numpy(), matrices.numpy(), atol=1e-9)
    assert torch.all(back[:, 0] >= 0)
    undone = quaternions.multiply(a, quaternions.conjugate(a)).numpy()
    np.testing.assert_allclose(undone, np.tile([1.0, 0, 0, 0], (30, 1)), atol=1e-12)
