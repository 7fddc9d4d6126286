"""What a renderer of Gaussians must do."""

import dataclasses
from typing import Protocol

import numpy as np
import torch

from animator.types import Camera, Gaussians


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Rendering:
    """An image of the Gaussians; differentiable where the Gaussians are."""

    rgb: torch.Tensor
    """Colour over the background, sRGB 0..1 (unclipped above), shape (H, W, 3)."""
    alpha: torch.Tensor
    """Coverage 0..1, shape (H, W)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Visibility:
    """What one camera sees of each Gaussian; no gradients."""

    contributions: np.ndarray
    """Sum over pixels of alpha times transmittance [px], shape (N,)."""
    visible_shares: np.ndarray
    """`contributions` over the same sum without any occluder (0 hidden, 1 in front), shape (N,)."""
    centres_px: np.ndarray
    """Projected centres, pixel centres at +0.5, shape (N, 2)."""
    depths: np.ndarray
    """Depth of the centres along +z [scene unit], shape (N,)."""


class Renderer(Protocol):
    """Draws Gaussians; implementations: `cpu` (numba) and `gsplat` (CUDA)."""

    device: torch.device
    """Where the Gaussians must live."""

    def render(
        self,
        gaussians: Gaussians,
        camera: Camera,
        *,
        background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Rendering:
        """Draw colour and alpha, differentiable in all five Gaussian fields."""
        ...

    def depth(self, gaussians: Gaussians, camera: Camera) -> torch.Tensor:
        """Draw the alpha-weighted mean depth [scene unit], 0 where nothing is seen; (H, W)."""
        ...

    def visibility(self, gaussians: Gaussians, camera: Camera) -> Visibility:
        """Measure how much of each Gaussian the camera sees."""
        ...
