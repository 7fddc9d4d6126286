"""How the object's surface brightens and darkens as it turns under a light that stays where it is.

A captured splat has its light baked in: each Gaussian's color is right for the way its surface faced at capture. Under
a light from one side and a sky from all, what a surface gets depends on its normal n alone, and smoothly: spherical
harmonics up to degree 2 hold nearly all of it (Ramamoorthi and Hanrahan 2001). Here up to degree 1, and of the
logarithm of the color, which changes by

    l . (R n - n)

when it turns by R. Three numbers l, "the light" here, say so for a whole clip. A surface that turns in depth, which a
picture hardly shows otherwise, shows in this.
"""

import torch

from animator import quaternions
from animator.deform.normals import surface_normals
from animator.types import Camera, Gaussians


class Shading:
    """The light on the Gaussians of one clip, and how they answer it."""

    def __init__(self, gaussians: Gaussians) -> None:
        """Find the normals.

        Args:
            gaussians: The rest pose.
        """
        normals = surface_normals(gaussians.means.detach().cpu().numpy())
        self._normals = torch.from_numpy(normals.directions).to(gaussians.means)
        own = quaternions.conjugate(quaternions.normalize(gaussians.quats_wxyz))
        self._normals_in_gaussian = quaternions.rotate(own, self._normals)
        self.trusts = torch.from_numpy(normals.trusts).to(gaussians.means)
        """How far a Gaussian has a normal at all, 0 to 1, shape (N,)."""
        self._sides = torch.ones_like(self.trusts)[:, None]
        self.light = gaussians.means.new_zeros(3)
        """World direction that brightens, times how much [natural logarithm of color]; 0 if not known, shape (3,)."""

    def look(self, posed: Gaussians, camera: Camera) -> None:
        """Take the side of each surface that faces the camera for the outer one: what faces away is not seen.

        Args:
            posed: The Gaussians in a pose near the ones that are asked about next.
            camera: Sees them.
        """
        with torch.no_grad():
            position = torch.as_tensor(camera.position).to(posed.means)
            facing = (self._turned(posed) * (posed.means - position)).sum(dim=1, keepdim=True)
            self._sides = torch.where(facing > 0, -1.0, 1.0)

    def normal_changes(self, posed: Gaussians) -> torch.Tensor:
        """Return how the outer normals have changed since rest, R n - n, in world axes, shape (N, 3)."""
        return (self._turned(posed) - self._normals) * self._sides

    def log_gains(self, posed: Gaussians) -> torch.Tensor | None:
        """Return the natural logarithms of what colors are multiplied by in a pose, shape (N,).

        Differentiable in the rotations. None stands for zeros: nothing is known of the light.
        """
        if not self.light.any():
            return None
        return self.trusts * (self.normal_changes(posed) @ self.light)

    def _turned(self, posed: Gaussians) -> torch.Tensor:
        return quaternions.rotate(posed.quats_wxyz, self._normals_in_gaussian)
