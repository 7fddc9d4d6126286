"""A slow, dense, double-precision renderer with gsplat's rules: the tests' second opinion.

It shares no code with the package: no tiles, no records, no hand-written derivative.
"""

import dataclasses

import numpy as np
import torch

from animator.types import Camera


@dataclasses.dataclass(frozen=True, kw_only=True)
class DenseRendering:
    """Colors over black, coverage, and where they must not be compared."""

    rgb: torch.Tensor
    alpha: torch.Tensor
    contributions: torch.Tensor
    """Sum of alpha T over the pixels, shape (N,)."""
    unoccluded: torch.Tensor
    """Sum of alpha over the pixels, shape (N,)."""
    depth_sum: torch.Tensor
    """Sum of alpha T z, shape (H, W)."""
    is_ambiguous: torch.Tensor
    """Pixels so close to one of the rules' thresholds that float32 may decide otherwise."""


def render_dense(fields: dict[str, torch.Tensor], camera: Camera) -> DenseRendering:
    """Draw float64 fields: means, quats_wxyz, scales, opacities, sh_coeffs."""
    width, height = camera.width_px, camera.height_px
    world = torch.from_numpy(camera.cam_from_world)
    k = camera.intrinsics
    means, opacities = fields["means"], fields["opacities"]
    count = len(means)
    points = means @ world[:3, :3].T + world[:3, 3]
    x, y, z = points.unbind(1)
    rotations = _matrices(torch.nn.functional.normalize(fields["quats_wxyz"], dim=1))
    axes = world[:3, :3] @ rotations * fields["scales"][:, None]
    colors = torch.clamp_min(_harmonics(fields["sh_coeffs"], means, camera) + 0.5, 0.0)

    columns, rows = torch.meshgrid(
        torch.arange(width) + 0.5, torch.arange(height) + 0.5, indexing="xy"
    )
    transmittance = torch.ones(height, width, dtype=torch.float64)
    is_open = torch.ones(height, width, dtype=torch.bool)
    is_ambiguous = torch.zeros(height, width, dtype=torch.bool)
    rgb = torch.zeros(height, width, 3, dtype=torch.float64)
    depth_sum = torch.zeros(height, width, dtype=torch.float64)
    contributions, unoccluded = np.zeros(count), np.zeros(count)
    for i in np.argsort(z.detach().numpy(), kind="stable"):
        if z[i] < 0.01:
            continue
        slope_x, slope_y = x[i] / z[i], y[i] / z[i]
        near_x = slope_x.clamp(
            -(k[0, 2] + 0.15 * width) / k[0, 0], (width - k[0, 2] + 0.15 * width) / k[0, 0]
        )
        near_y = slope_y.clamp(
            -(k[1, 2] + 0.15 * height) / k[1, 1], (height - k[1, 2] + 0.15 * height) / k[1, 1]
        )
        zero = torch.zeros((), dtype=torch.float64)
        jacobian = torch.stack(
            [
                torch.stack([k[0, 0] / z[i], zero, -k[0, 0] * near_x / z[i]]),
                torch.stack([zero, k[1, 1] / z[i], -k[1, 1] * near_y / z[i]]),
            ]
        )
        spread = jacobian @ axes[i]
        covariance = spread @ spread.T + 0.3 * torch.eye(2, dtype=torch.float64)
        inverse = torch.linalg.inv(covariance)
        dx = columns - (k[0, 0] * slope_x + k[0, 2])
        dy = rows - (k[1, 1] * slope_y + k[1, 2])
        sigma = 0.5 * (inverse[0, 0] * dx * dx + inverse[1, 1] * dy * dy) + inverse[0, 1] * dx * dy
        raw = opacities[i] * torch.exp(-sigma)
        is_drawn = raw >= 1 / 255
        alpha = torch.where(is_drawn, raw.clamp_max(0.999), 0.0)
        after = transmittance * (1 - alpha)
        is_ambiguous |= (
            is_open
            & (
                ((255 * raw - 1).abs() < 1e-3)
                | ((raw / 0.999 - 1).abs() < 1e-5)
                | ((after / 1e-4 - 1).abs() < 1e-2)
            ).detach()
        )
        unoccluded[i] = float(alpha.detach().sum())
        is_open = is_open & ~(is_drawn & (after <= 1e-4))
        weight = torch.where(is_open, alpha * transmittance, 0.0)
        transmittance = transmittance - weight
        rgb = rgb + weight[:, :, None] * colors[i]
        depth_sum = depth_sum + weight * z[i]
        contributions[i] = float(weight.detach().sum())
    return DenseRendering(
        rgb=rgb,
        alpha=1 - transmittance,
        contributions=torch.from_numpy(contributions),
        unoccluded=torch.from_numpy(unoccluded),
        depth_sum=depth_sum,
        is_ambiguous=is_ambiguous,
    )


def _matrices(unit: torch.Tensor) -> torch.Tensor:
    """Rodrigues' formula: I + 2 w [u] + 2 [u]^2."""
    w, x, y, z = unit.unbind(1)
    zero = torch.zeros_like(w)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], 1).reshape(-1, 3, 3)
    return torch.eye(3, dtype=unit.dtype) + 2 * w[:, None, None] * cross + 2 * cross @ cross


def _harmonics(coefficients: torch.Tensor, means: torch.Tensor, camera: Camera) -> torch.Tensor:
    """Real spherical harmonics from scipy's complex ones, in the order m = -l..l.

    Splatting keeps the Condon-Shortley phase in the real functions: for m > 0 they are
    sqrt(2) Re Y_lm, for m < 0 sqrt(2) Im Y_l|m|, with scipy's Y that has the phase.
    """
    degree = int(coefficients.shape[1] ** 0.5) - 1
    position = torch.from_numpy(camera.position)
    directions = torch.nn.functional.normalize(means - position, dim=1)
    basis = []
    for order in range(degree + 1):
        for m in range(-order, order + 1):
            basis.append(_RealHarmonic.apply(directions, order, m))
    return torch.einsum("nk,nkc->nc", torch.stack(basis, 1), coefficients)


class _RealHarmonic(torch.autograd.Function):
    """A harmonic by scipy, its gradient along the sphere by central differences."""

    @staticmethod
    def forward(ctx, directions, order, m):
        ctx.save_for_backward(directions)
        ctx.order, ctx.m = order, m
        return torch.from_numpy(real_harmonic(directions.detach().numpy(), order, m))

    @staticmethod
    def backward(ctx, grad):
        (directions,) = ctx.saved_tensors
        points, step = directions.numpy(), 1e-5
        slopes = np.zeros_like(points)
        for axis in range(3):
            shift = np.zeros(3)
            shift[axis] = step
            above = real_harmonic(points + shift, ctx.order, ctx.m)
            below = real_harmonic(points - shift, ctx.order, ctx.m)
            slopes[:, axis] = (above - below) / (2 * step)
        return grad[:, None] * torch.from_numpy(slopes), None, None


def real_harmonic(directions: np.ndarray, order: int, m: int) -> np.ndarray:
    """Evaluate one real spherical harmonic, with the Condon-Shortley phase."""
    from scipy.special import sph_harm_y

    x, y, z = directions.T
    theta = np.arctan2(np.hypot(x, y), z)
    value = sph_harm_y(order, abs(m), theta, np.arctan2(y, x))
    if m == 0:
        return value.real
    return np.sqrt(2) * (value.real if m > 0 else value.imag)
