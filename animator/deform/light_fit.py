"""The light, from how much brighter or darker frames are than what was drawn."""

import dataclasses

import numpy as np

from animator.deform.robust_norm import RobustNorm

_WIDER = (8.0, 4.0, 2.0, 1.0, 1.0)
"""Times the noise, round after round: at first a light that is not known yet must not pass for noise (graduated
non-convexity, Blake and Zisserman 1987)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class LightSamples:
    """One frame, at M visible Gaussians."""

    normal_changes: np.ndarray
    """Outer normals now less those at rest, in world axes, shape (M, 3)."""
    log_ratios: np.ndarray
    """Natural logarithms of the frame's brightness over that at rest, shape (M,)."""


class LightFit:
    """Robust least squares, frame after frame, with a brightness of its own for each frame.

    The last is an automatic exposure; without it, that would pass for a light.
    """

    def __init__(self, *, spread: float, noise: float, alike: float) -> None:
        """Start with no light.

        Args:
            spread: Standard deviation of the light that is expected [natural logarithm of color].
            noise: Residual at which a sample counts for a quarter, likewise: a wrong place, or another color.
            alike: Samples that err together, and so count as one.
        """
        self._prior = np.eye(3) * alike * (noise / spread) ** 2
        self._norms = [RobustNorm(reach=wider * noise) for wider in _WIDER]
        self._matrix = np.zeros((3, 3))
        self._vector = np.zeros(3)
        self.light = np.zeros(3)
        """The estimate so far: a world direction, times how much it brightens, shape (3,)."""

    def add(self, samples: LightSamples) -> None:
        """Take another frame into account."""
        changes, log_ratios = samples.normal_changes, samples.log_ratios
        if len(changes) == 0:
            return
        exposure = float(np.median(log_ratios - changes @ self.light))
        matrix, vector = self._matrix, self._vector
        for norm in self._norms:
            weights = norm.weight((log_ratios - changes @ self.light - exposure) ** 2)
            total = max(float(weights.sum()), 1e-12)
            middle = weights @ changes / total
            arms = (changes - middle) * weights[:, None]
            matrix = self._matrix + arms.T @ changes
            vector = self._vector + arms.T @ log_ratios
            self.light = np.linalg.solve(matrix + self._prior, vector)
            exposure = float(weights @ log_ratios / total - middle @ self.light)
        self._matrix, self._vector = matrix, vector
