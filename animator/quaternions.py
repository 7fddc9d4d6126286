"""Quaternion arithmetic on torch tensors, `wxyz`, broadcasting over leading axes."""

import torch


def normalize(quats_wxyz: torch.Tensor) -> torch.Tensor:
    """Return unit quaternions, shape (..., 4)."""
    return torch.nn.functional.normalize(quats_wxyz, dim=-1)


def conjugate(quats_wxyz: torch.Tensor) -> torch.Tensor:
    """Return the inverses of unit quaternions, shape (..., 4)."""
    return quats_wxyz * quats_wxyz.new_tensor([1.0, -1.0, -1.0, -1.0])


def multiply(left_wxyz: torch.Tensor, right_wxyz: torch.Tensor) -> torch.Tensor:
    """Return the Hamilton product: first `right` rotates, then `left`. Shape (..., 4)."""
    w1, x1, y1, z1 = left_wxyz.unbind(-1)
    w2, x2, y2, z2 = right_wxyz.unbind(-1)
    return torch.stack(
        [
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ],
        dim=-1,
    )


def rotate(quats_wxyz: torch.Tensor, vectors: torch.Tensor) -> torch.Tensor:
    """Rotate vectors by unit quaternions: v + 2 u x (u x v + w v). Shape (..., 3)."""
    w, u = quats_wxyz[..., :1], quats_wxyz[..., 1:]
    return vectors + 2.0 * torch.linalg.cross(u, torch.linalg.cross(u, vectors) + w * vectors)


def to_matrices(quats_wxyz: torch.Tensor) -> torch.Tensor:
    """Return the rotation matrices of unit quaternions, for column vectors. Shape (..., 3, 3)."""
    w, x, y, z = quats_wxyz.unbind(-1)
    entries = [
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    ]
    return torch.stack(entries, dim=-1).unflatten(-1, (3, 3))


def from_matrices(rotations: torch.Tensor) -> torch.Tensor:
    """Return unit quaternions with w >= 0 of rotation matrices, shape (..., 4).

    Takes the largest of the four candidate formulae (Shepperd 1978), so that none divides by nearly zero.
    """
    m = rotations
    diagonal = [m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]]
    x, y, z = (
        m[..., 2, 1] - m[..., 1, 2],
        m[..., 0, 2] - m[..., 2, 0],
        m[..., 1, 0] - m[..., 0, 1],
    )
    xy, xz, yz = (
        m[..., 0, 1] + m[..., 1, 0],
        m[..., 0, 2] + m[..., 2, 0],
        m[..., 1, 2] + m[..., 2, 1],
    )
    trace = diagonal[0] + diagonal[1] + diagonal[2]
    # Row k is 4 q_k q: four parallel quaternions, the longest of which is the best conditioned.
    parallel = torch.stack(
        [
            torch.stack([1 + trace, x, y, z], dim=-1),
            torch.stack([x, 1 + 2 * diagonal[0] - trace, xy, xz], dim=-1),
            torch.stack([y, xy, 1 + 2 * diagonal[1] - trace, yz], dim=-1),
            torch.stack([z, xz, yz, 1 + 2 * diagonal[2] - trace], dim=-1),
        ],
        dim=-2,
    )
    longest = parallel.norm(dim=-1).argmax(dim=-1)
    index = longest[..., None, None].expand(*longest.shape, 1, 4)
    quats = normalize(parallel.gather(-2, index)[..., 0, :])
    return torch.where(quats[..., :1] < 0, -quats, quats)
