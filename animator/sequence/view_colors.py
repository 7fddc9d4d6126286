"""Colors as one camera sees them, frozen while a frame is solved.

Spherical harmonics change slowly with the view; evaluated at every step they would cost more than the drawing.
"""

import dataclasses

import torch

from animator.render.spherical_harmonics import SH_C0, evaluate_colors
from animator.types import Camera, Gaussians


class ViewColors:
    """Replaces view-dependent colors by those of the last `look`."""

    def __init__(self) -> None:
        self._sh_coeffs: torch.Tensor | None = None

    def look(self, gaussians: Gaussians, camera: Camera) -> None:
        """Evaluate the colors for a camera; nothing to do for Gaussians of degree 0."""
        if gaussians.sh_coeffs.shape[1] == 1:
            return
        with torch.no_grad():
            position = torch.as_tensor(camera.position).to(gaussians.means)
            colors = evaluate_colors(gaussians.sh_coeffs, gaussians.means, position)
        self._sh_coeffs = ((colors - 0.5) / SH_C0)[:, None]

    def paint(self, gaussians: Gaussians) -> Gaussians:
        """Return the Gaussians in the colors of the last `look`."""
        if self._sh_coeffs is None:
            return gaussians
        return dataclasses.replace(gaussians, sh_coeffs=self._sh_coeffs)

    def base_colors(self, gaussians: Gaussians) -> torch.Tensor:
        """Return one color a Gaussian, as seen at the last `look`, shape (N, 3)."""
        return self.paint(gaussians).sh_coeffs[:, 0].detach() * SH_C0 + 0.5
