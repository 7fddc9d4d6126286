"""View-dependent colors from real spherical harmonics."""

import torch

# Constants of the real basis in Cartesian form, in the order and with the signs that the original
# implementation (Kerbl et al. 2023) and gsplat use; e.g. SH_C0 = Y_0^0 = 1 / (2 sqrt(pi)).
SH_C0 = 0.28209479177387814
SH_C1 = 0.4886025119029199
SH_C2 = (1.0925484305920792, 0.31539156525252005, 0.5462742152960396)
SH_C3 = (
    0.5900435899266435,
    2.890611442640554,
    0.4570457994644658,
    0.3731763325901154,
    1.445305721320277,
)


def evaluate_colors(
    sh_coeffs: torch.Tensor, means: torch.Tensor, camera_position: torch.Tensor
) -> torch.Tensor:
    """Return the colors of Gaussians as seen from a point: SH(direction) + 0.5, not below 0.

    Differentiable in the coefficients, and above degree 0 in the means.

    Args:
        sh_coeffs: Coefficients, shape (N, K, 3), K in {1, 4, 9, 16}.
        means: Centres [scene unit], shape (N, 3).
        camera_position: Where the camera is [scene unit], shape (3,).

    Returns:
        sRGB colors >= 0, shape (N, 3).

    Raises:
        ValueError: If K is none of the four.
    """
    count = sh_coeffs.shape[1]
    if count not in (1, 4, 9, 16):
        raise ValueError(
            "sh_coeffs: expected 1, 4, 9 or 16 coefficients a channel (degree 0 to 3), "
            f"found {count}"
        )
    if count == 1:
        return torch.clamp_min(sh_coeffs[:, 0] * SH_C0 + 0.5, 0.0)
    directions = torch.nn.functional.normalize(means - camera_position, dim=1)
    basis = _basis(directions, count)
    return torch.clamp_min((basis[:, None] @ sh_coeffs)[:, 0] + 0.5, 0.0)


def _basis(directions: torch.Tensor, count: int) -> torch.Tensor:
    """Return the first `count` basis functions at unit directions, shape (N, count)."""
    x, y, z = directions.unbind(1)
    basis = [torch.full_like(x, SH_C0), -SH_C1 * y, SH_C1 * z, -SH_C1 * x]
    if count > 4:
        xx, yy, zz = x * x, y * y, z * z
        basis += [
            SH_C2[0] * x * y,
            -SH_C2[0] * y * z,
            SH_C2[1] * (2.0 * zz - xx - yy),
            -SH_C2[0] * x * z,
            SH_C2[2] * (xx - yy),
        ]
        if count > 9:
            basis += [
                -SH_C3[0] * y * (3.0 * xx - yy),
                SH_C3[1] * x * y * z,
                -SH_C3[2] * y * (4.0 * zz - xx - yy),
                SH_C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
                -SH_C3[2] * x * (4.0 * zz - xx - yy),
                SH_C3[4] * z * (xx - yy),
                -SH_C3[0] * x * (xx - 3.0 * yy),
            ]
    return torch.stack(basis, dim=1)
