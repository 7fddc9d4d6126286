"""The renderer for CUDA devices: gsplat behind the same protocol."""

import math

import torch

from animator.render import splat_rules
from animator.render.pinhole import check_pinhole
from animator.render.protocol import Rendering, Visibility
from animator.types import Camera, Gaussians


class GsplatRenderer:
    """Draws Gaussians with gsplat; implements `render.protocol.Renderer`."""

    device = torch.device("cuda")

    def render(
        self,
        gaussians: Gaussians,
        camera: Camera,
        *,
        background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Rendering:
        """Draw color and alpha, differentiable in all five Gaussian fields.

        Raises:
            InputError: If the camera is no pinhole, see `check_pinhole`.
        """
        degree = math.isqrt(gaussians.sh_coeffs.shape[1]) - 1
        rgb, alpha, _ = self._rasterize(gaussians, camera, gaussians.sh_coeffs, sh_degree=degree)
        if any(background):
            rgb = rgb + (1.0 - alpha)[:, :, None] * rgb.new_tensor(background)
        return Rendering(rgb=rgb, alpha=alpha)

    def depth(self, gaussians: Gaussians, camera: Camera) -> torch.Tensor:
        """Draw the alpha-weighted mean depth [scene unit], 0 where nothing is seen; (H, W)."""
        world = torch.from_numpy(camera.cam_from_world).to(gaussians.means)
        depths = gaussians.means @ world[2, :3] + world[2, 3]
        drawn, alpha, _ = self._rasterize(gaussians, camera, depths[:, None])
        is_seen = alpha > 0
        return torch.where(is_seen, drawn[:, :, 0] / torch.where(is_seen, alpha, 1.0), 0.0)

    def visibility(self, gaussians: Gaussians, camera: Camera) -> Visibility:
        """Measure how much of each Gaussian the camera sees.

        An image whose color is constant 1 has the sum of alpha T as its gradient by that color, so
        one backward pass measures all contributions. gsplat offers no such sum without occluders;
        the shares compare with the integral of a projected Gaussian above the threshold,
        2 pi sqrt(det C) (opacity - ALPHA_MIN), and so are too low for Gaussians cut by the border.
        """
        ones = torch.ones(len(gaussians), 1, device=gaussians.means.device, requires_grad=True)
        with torch.enable_grad():
            drawn, _, meta = self._rasterize(_detached(gaussians), camera, ones)
            (seen,) = torch.autograd.grad(drawn.sum(), ones)
        inverse_xx, inverse_xy, inverse_yy = meta["conics"][0].detach().unbind(-1)
        determinant = (inverse_xx * inverse_yy - inverse_xy**2).clamp_min(1e-20)
        excess = (gaussians.opacities.detach() - splat_rules.ALPHA_MIN).clamp_min(0)
        alone = 2 * math.pi * excess / determinant.sqrt()
        seen = seen[:, 0]
        shares = torch.where(seen > 0, (seen / alone.clamp_min(1e-12)).clamp(0, 1), 0.0)
        centres_px, depths = camera.project(gaussians.means.detach().cpu().double().numpy())
        return Visibility(
            contributions=seen.cpu().double().numpy(),
            visible_shares=shares.cpu().double().numpy(),
            centres_px=centres_px,
            depths=depths,
        )

    def _rasterize(
        self,
        gaussians: Gaussians,
        camera: Camera,
        colors: torch.Tensor,
        *,
        sh_degree: int | None = None,
    ) -> tuple[torch.Tensor, torch.Tensor, dict]:
        """Return channels (H, W, D), alpha (H, W) and gsplat's intermediate results."""
        from gsplat import rasterization

        check_pinhole(camera)
        drawn, alpha, meta = rasterization(
            means=gaussians.means,
            quats=gaussians.quats_wxyz,
            scales=gaussians.scales,
            opacities=gaussians.opacities,
            colors=colors,
            viewmats=torch.from_numpy(camera.cam_from_world).to(gaussians.means)[None],
            Ks=torch.from_numpy(camera.intrinsics).to(gaussians.means)[None],
            width=camera.width_px,
            height=camera.height_px,
            near_plane=splat_rules.NEAR,
            eps2d=splat_rules.BLUR_PX2,
            sh_degree=sh_degree,
            packed=False,
        )
        return drawn[0], alpha[0, :, :, 0], meta


def _detached(gaussians: Gaussians) -> Gaussians:
    return Gaussians(
        means=gaussians.means.detach(),
        quats_wxyz=gaussians.quats_wxyz.detach(),
        scales=gaussians.scales.detach(),
        opacities=gaussians.opacities.detach(),
        sh_coeffs=gaussians.sh_coeffs.detach(),
    )
