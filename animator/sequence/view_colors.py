"""Colors as one camera sees them, frozen while a frame is solved but for what the light does.

Spherical harmonics change slowly with the view; evaluated at every step they would cost more than the drawing. What
turns under a light changes at once, and that says how it turned.
"""

import dataclasses

import torch

from animator.deform.shading import Shading
from animator.render.spherical_harmonics import SH_C0, evaluate_colors
from animator.types import Camera, Gaussians


class ViewColors:
    """Replaces view-dependent colors by those of the last `look`, in the light if there is one."""

    def __init__(self, shading: Shading | None = None) -> None:
        self._shading = shading
        self._of_view: torch.Tensor | None = None
        self._seen: Gaussians | None = None

    def look(self, gaussians: Gaussians, camera: Camera) -> None:
        """Evaluate the colors of a pose for a camera."""
        with torch.no_grad():
            # Those of degree 0 are the same for all cameras.
            if gaussians.sh_coeffs.shape[1] > 1:
                position = torch.as_tensor(camera.position).to(gaussians.means)
                colors = evaluate_colors(gaussians.sh_coeffs, gaussians.means, position)
                self._of_view = _coefficients(colors)
            if self._shading is not None:
                self._shading.look(gaussians, camera)
        self._seen = gaussians

    def paint(self, gaussians: Gaussians) -> Gaussians:
        """Return a pose in the colors of the last `look`, in the light that falls on it now."""
        if self._of_view is not None:
            gaussians = dataclasses.replace(gaussians, sh_coeffs=self._of_view)
        log_gains = None if self._shading is None else self._shading.log_gains(gaussians)
        if log_gains is None:
            return gaussians
        colors = _colors(gaussians) * log_gains.exp()[:, None]
        return dataclasses.replace(gaussians, sh_coeffs=_coefficients(colors))

    def paint_as_seen(self, gaussians: Gaussians) -> Gaussians:
        """Return a pose in the colors of the one that was looked at last."""
        if self._seen is None:
            return gaussians
        with torch.no_grad():
            return dataclasses.replace(gaussians, sh_coeffs=self.paint(self._seen).sh_coeffs)

    def base_colors(self, gaussians: Gaussians) -> torch.Tensor:
        """Return one color a Gaussian, as `paint` would have it, shape (N, 3)."""
        return _colors(self.paint(gaussians)).detach()


def _colors(gaussians: Gaussians) -> torch.Tensor:
    return gaussians.sh_coeffs[:, 0] * SH_C0 + 0.5


def _coefficients(colors: torch.Tensor) -> torch.Tensor:
    return ((colors - 0.5) / SH_C0)[:, None]
