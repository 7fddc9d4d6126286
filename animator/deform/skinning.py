"""Moving Gaussians with their anchors: the blend skinning of paper Eq. 2, with gradients.

A Gaussian with rest centre mu and rotation q, influences k with weights w_k:

    mu' = sum_k w_k (R_k (mu - a_k) + a_k + T_k)
    q'  = normalize(sum_k w_k s_k q_k) * q

where s_k = +-1 turns q_k into the half-space of the first influence, since q and -q are the same
rotation. Rotations act on the left: the paper prints q * q_blend, at odds with its Eqs. 1 and 4.
"""

from typing import Any, NamedTuple

import numpy as np
import torch
from numba import njit, prange

from animator.jit.kernel import RELAXED, kernel
from animator.types import AnchorPoses, Anchors

_F = np.float32
_ZERO = _F(0)
_HALF = _F(0.5)
_ONE = _F(1)
_TWO = _F(2)

_CHUNK = 2048
"""Gaussians that share one gradient accumulator; fixed, so that sums do not depend on threads."""

_MAX_CHUNKS = 16
"""Upper bound of the accumulators, which must stay small beside the Gaussians themselves."""


class _Table(NamedTuple):
    """The anchors' transforms as the kernels read them."""

    transforms: np.ndarray
    """R_k by rows (9), a_k + T_k - R_k a_k (3), unit q_k (4): float32, shape (A, 16)."""
    is_one_sided: bool
    """Whether all rotations lie in one half-space, so that no sign needs a look."""


class Skinner:
    """The Gaussians of one clip, ready to be posed again and again."""

    def __init__(self, anchors: Anchors, means: torch.Tensor, quats_wxyz: torch.Tensor):
        """Gather what stays constant over the clip.

        Args:
            anchors: The control points with their skinning weights.
            means: Rest centres of the Gaussians [scene unit], shape (N, 3).
            quats_wxyz: Rest rotations of the Gaussians, unit, shape (N, 4).

        Raises:
            ValueError: If the weights are not one row a Gaussian, or name an anchor that is not.
        """
        _check_influences(anchors, len(means))
        self.device = means.device
        # Relative to the middle of the object: far from the origin, R a and a would cancel badly.
        means = means.detach().to("cpu", torch.float64)
        self._centre = means.mean(dim=0) if len(means) else means.new_zeros(3)
        self._means = _array(means - self._centre, np.float32)
        self._quats = _array(quats_wxyz, np.float32)
        self._ids = _array(anchors.skin_ids, np.int32)
        self._weights = _array(anchors.skin_weights, np.float32)
        positions = anchors.positions.detach().to("cpu", torch.float64)
        self._anchors = _array(positions - self._centre, np.float32)
        self._origin = _array(self._centre, np.float32)
        chunk_count = min(_MAX_CHUNKS, -(-len(self._means) // _CHUNK))
        self._accumulators = np.zeros((chunk_count, len(anchors), 16), np.float32)

    def __call__(self, poses: AnchorPoses) -> tuple[torch.Tensor, torch.Tensor]:
        """Pose the Gaussians; differentiable in `poses.quats_wxyz` and `poses.translations` only.

        The rotations need not be exactly unit: their direction counts, and gradients along the
        length of a quaternion are zero.

        Returns:
            Centres [scene unit], shape (N, 3), and unit rotations `wxyz`, shape (N, 4).
        """
        quats, translations = poses.quats_wxyz, poses.translations
        means, quats = _Skin.apply(quats.float().cpu(), translations.float().cpu(), self)
        return means.to(self.device), quats.to(self.device)

    def _pose(
        self, anchor_quats: np.ndarray, translations: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, "_Table"]:
        """Return the posed centres and rotations, and the table of anchor transforms."""
        transforms = np.empty((len(self._anchors), 16), np.float32)
        is_one_sided = _tabulate(anchor_quats, translations, self._anchors, transforms)
        table = _Table(transforms, is_one_sided)
        means, quats = np.empty_like(self._means), np.empty_like(self._quats)
        influences = (self._ids, self._weights)
        rest = (self._means, self._quats)
        _skin_forward(*table, influences, rest, self._origin, (means, quats))
        return means, quats, table

    def _pose_gradients(
        self, anchor_quats: np.ndarray, table: "_Table", grads: tuple[np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the gradients of the anchors' rotations and translations."""
        influences = (self._ids, self._weights)
        rest = (self._means, self._quats)
        _skin_backward(*table, influences, rest, grads, self._accumulators)
        grad_quats, grad_translations = np.empty_like(anchor_quats), np.empty_like(self._anchors)
        _reduce_to_poses(
            self._accumulators, anchor_quats, self._anchors, (grad_quats, grad_translations)
        )
        return grad_quats, grad_translations


def skin(
    means: torch.Tensor, quats_wxyz: torch.Tensor, anchors: Anchors, poses: AnchorPoses
) -> tuple[torch.Tensor, torch.Tensor]:
    """Pose Gaussians once; see `Skinner`, which is cheaper when the same ones are posed again."""
    return Skinner(anchors, means, quats_wxyz)(poses)


def _check_influences(anchors: Anchors, gaussian_count: int) -> None:
    ids, weights = anchors.skin_ids, anchors.skin_weights
    if ids.ndim != 2 or ids.shape != weights.shape or len(ids) != gaussian_count:
        raise ValueError(
            f"anchors.skin_ids and skin_weights: expected one row for each of {gaussian_count} "
            f"Gaussians, found shapes {tuple(ids.shape)} and {tuple(weights.shape)}; build the "
            "anchors from the same Gaussians"
        )
    if ids.numel() and not 0 <= int(ids.min()) <= int(ids.max()) < len(anchors):
        raise ValueError(
            f"anchors.skin_ids: expected values in 0..{len(anchors) - 1}, found "
            f"{int(ids.min())}..{int(ids.max())}; build the weights from the same anchors"
        )


def _array(tensor: torch.Tensor, dtype: type) -> np.ndarray:
    return np.ascontiguousarray(tensor.detach().cpu().numpy(), dtype=dtype)


class _Skin(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, quats: torch.Tensor, translations: torch.Tensor, skinner: Skinner) -> Any:
        anchor_quats = _array(quats, np.float32)
        means, posed_quats, ctx.table = skinner._pose(
            anchor_quats, _array(translations, np.float32)
        )
        ctx.anchor_quats, ctx.skinner = anchor_quats, skinner
        return torch.from_numpy(means), torch.from_numpy(posed_quats)

    @staticmethod
    def backward(ctx: Any, *grads: torch.Tensor) -> Any:
        grad_means, grad_quats = (_array(grad, np.float32) for grad in grads)
        anchor_grads = ctx.skinner._pose_gradients(
            ctx.anchor_quats, ctx.table, (grad_means, grad_quats)
        )
        return *map(torch.from_numpy, anchor_grads), None


@kernel()
def _tabulate(anchor_quats, translations, anchors, transforms):
    """Fill the table; return whether no two rotations can lie in opposite half-spaces.

    They cannot if all are within 45 degrees (as quaternions) of one direction. That is the usual
    case, and saves comparing the signs of every Gaussian's influences.
    """
    middle = np.zeros(4, np.float32)
    for k in range(anchors.shape[0]):
        w, x, y, z, _inverse_norm = _unit(anchor_quats, k)
        row = transforms[k]
        row[0] = _ONE - _TWO * (y * y + z * z)
        row[1] = _TWO * (x * y - w * z)
        row[2] = _TWO * (x * z + w * y)
        row[3] = _TWO * (x * y + w * z)
        row[4] = _ONE - _TWO * (x * x + z * z)
        row[5] = _TWO * (y * z - w * x)
        row[6] = _TWO * (x * z - w * y)
        row[7] = _TWO * (y * z + w * x)
        row[8] = _ONE - _TWO * (x * x + y * y)
        for r in range(3):
            rotated = _ZERO
            for c in range(3):
                rotated += row[3 * r + c] * anchors[k, c]
            row[9 + r] = anchors[k, r] - rotated + translations[k, r]
        row[12], row[13], row[14], row[15] = w, x, y, z
        middle += row[12:]
    closest = _HALF * np.sum(middle * middle)
    for k in range(anchors.shape[0]):
        along = np.sum(transforms[k, 12:] * middle)
        if along <= _ZERO or along * along <= closest:
            return False
    return True


@njit(fastmath=True, error_model="numpy")
def _unit(quats, index):
    """Return the normalized quaternion of a row and one over its norm (identity if it is zero)."""
    w, x, y, z = quats[index, 0], quats[index, 1], quats[index, 2], quats[index, 3]
    squared = w * w + x * x + y * y + z * z
    if squared == _ZERO:
        return _ONE, _ZERO, _ZERO, _ZERO, _ZERO
    inverse_norm = _ONE / np.sqrt(squared)
    return w * inverse_norm, x * inverse_norm, y * inverse_norm, z * inverse_norm, inverse_norm


@njit(fastmath=True, error_model="numpy")
def _signed_weight(weight, row, first, is_one_sided):
    """Return the weight of a rotation, negated if it lies opposite the first influence's."""
    if is_one_sided:
        return weight
    dot = row[12] * first[12] + row[13] * first[13] + row[14] * first[14] + row[15] * first[15]
    return -weight if dot < _ZERO else weight


@kernel(parallel=True, fastmath=RELAXED)
def _skin_forward(transforms, is_one_sided, influences, rest, origin, posed):
    ids, weights = influences
    means, quats = rest
    posed_means, posed_quats = posed
    for i in prange(means.shape[0]):
        x, y, z = means[i, 0], means[i, 1], means[i, 2]
        mean_x = origin[0]
        mean_y = origin[1]
        mean_z = origin[2]
        b0 = _ZERO
        b1 = _ZERO
        b2 = _ZERO
        b3 = _ZERO
        first = transforms[ids[i, 0]]
        for j in range(ids.shape[1]):
            m = transforms[ids[i, j]]
            weight = weights[i, j]
            mean_x += weight * (m[0] * x + m[1] * y + m[2] * z + m[9])
            mean_y += weight * (m[3] * x + m[4] * y + m[5] * z + m[10])
            mean_z += weight * (m[6] * x + m[7] * y + m[8] * z + m[11])
            signed = _signed_weight(weight, m, first, is_one_sided)
            b0 += signed * m[12]
            b1 += signed * m[13]
            b2 += signed * m[14]
            b3 += signed * m[15]
        posed_means[i, 0] = mean_x
        posed_means[i, 1] = mean_y
        posed_means[i, 2] = mean_z
        inverse_norm = _ONE / np.sqrt(b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3)
        b0 *= inverse_norm
        b1 *= inverse_norm
        b2 *= inverse_norm
        b3 *= inverse_norm
        r0, r1, r2, r3 = quats[i, 0], quats[i, 1], quats[i, 2], quats[i, 3]
        posed_quats[i, 0] = b0 * r0 - b1 * r1 - b2 * r2 - b3 * r3
        posed_quats[i, 1] = b0 * r1 + b1 * r0 + b2 * r3 - b3 * r2
        posed_quats[i, 2] = b0 * r2 - b1 * r3 + b2 * r0 + b3 * r1
        posed_quats[i, 3] = b0 * r3 + b1 * r2 - b2 * r1 + b3 * r0


@kernel(parallel=True, fastmath=RELAXED)
def _skin_backward(transforms, is_one_sided, influences, rest, grads, accumulators):
    ids, weights = influences
    means, quats = rest
    grad_means, grad_quats = grads
    count, chunks = means.shape[0], accumulators.shape[0]
    for chunk in prange(chunks):
        table = accumulators[chunk]
        table[:] = _ZERO
        unit = np.empty(16, np.float32)
        signed = np.empty(ids.shape[1], np.float32)
        for i in range(count * chunk // chunks, count * (chunk + 1) // chunks):
            x, y, z = means[i, 0], means[i, 1], means[i, 2]
            gx, gy, gz = grad_means[i, 0], grad_means[i, 1], grad_means[i, 2]
            b0 = _ZERO
            b1 = _ZERO
            b2 = _ZERO
            b3 = _ZERO
            first = transforms[ids[i, 0]]
            for j in range(ids.shape[1]):
                m = transforms[ids[i, j]]
                signed[j] = _signed_weight(weights[i, j], m, first, is_one_sided)
                b0 += signed[j] * m[12]
                b1 += signed[j] * m[13]
                b2 += signed[j] * m[14]
                b3 += signed[j] * m[15]
            inverse_norm = _ONE / np.sqrt(b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3)
            b0 *= inverse_norm
            b1 *= inverse_norm
            b2 *= inverse_norm
            b3 *= inverse_norm
            r0, r1, r2, r3 = quats[i, 0], quats[i, 1], quats[i, 2], quats[i, 3]
            g0, g1, g2, g3 = grad_quats[i, 0], grad_quats[i, 1], grad_quats[i, 2], grad_quats[i, 3]
            # Through the product: gradient times the conjugate of the rest rotation.
            h0 = g0 * r0 + g1 * r1 + g2 * r2 + g3 * r3
            h1 = -g0 * r1 + g1 * r0 - g2 * r3 + g3 * r2
            h2 = -g0 * r2 + g1 * r3 + g2 * r0 - g3 * r1
            h3 = -g0 * r3 - g1 * r2 + g2 * r1 + g3 * r0
            # Through the normalization: only the part tangent to the sphere.
            along = h0 * b0 + h1 * b1 + h2 * b2 + h3 * b3
            h0 = (h0 - along * b0) * inverse_norm
            h1 = (h1 - along * b1) * inverse_norm
            h2 = (h2 - along * b2) * inverse_norm
            h3 = (h3 - along * b3) * inverse_norm
            # What an influence of weight 1 gets; a loop over it compiles to vector instructions.
            unit[0] = gx * x
            unit[1] = gx * y
            unit[2] = gx * z
            unit[3] = gy * x
            unit[4] = gy * y
            unit[5] = gy * z
            unit[6] = gz * x
            unit[7] = gz * y
            unit[8] = gz * z
            unit[9] = gx
            unit[10] = gy
            unit[11] = gz
            unit[12] = h0
            unit[13] = h1
            unit[14] = h2
            unit[15] = h3
            for j in range(ids.shape[1]):
                k, weight, signed_weight = ids[i, j], weights[i, j], signed[j]
                for c in range(12):
                    table[k, c] += weight * unit[c]
                for c in range(12, 16):
                    table[k, c] += signed_weight * unit[c]


@kernel()
def _reduce_to_poses(accumulators, anchor_quats, anchors, grads):
    grad_quats, grad_translations = grads
    total = np.empty(16, np.float32)
    for k in range(anchors.shape[0]):
        total[:] = _ZERO
        for chunk in range(accumulators.shape[0]):
            for c in range(16):
                total[c] += accumulators[chunk, k, c]
        # The offset a + T - R a also moves with R.
        for r in range(3):
            grad_translations[k, r] = total[9 + r]
            for c in range(3):
                total[3 * r + c] -= total[9 + r] * anchors[k, c]
        w, x, y, z, inverse_norm = _unit(anchor_quats, k)
        g00, g01, g02 = total[0], total[1], total[2]
        g10, g11, g12 = total[3], total[4], total[5]
        g20, g21, g22 = total[6], total[7], total[8]
        gw = total[12] + _TWO * (x * (g21 - g12) + y * (g02 - g20) + z * (g10 - g01))
        gx = total[13] + _TWO * (
            -_TWO * x * (g11 + g22) + y * (g10 + g01) + z * (g20 + g02) + w * (g21 - g12)
        )
        gy = total[14] + _TWO * (
            x * (g10 + g01) - _TWO * y * (g00 + g22) + z * (g21 + g12) + w * (g02 - g20)
        )
        gz = total[15] + _TWO * (
            x * (g20 + g02) + y * (g21 + g12) - _TWO * z * (g00 + g11) + w * (g10 - g01)
        )
        along = gw * w + gx * x + gy * y + gz * z
        grad_quats[k, 0] = (gw - along * w) * inverse_norm
        grad_quats[k, 1] = (gx - along * x) * inverse_norm
        grad_quats[k, 2] = (gy - along * y) * inverse_norm
        grad_quats[k, 3] = (gz - along * z) * inverse_norm
