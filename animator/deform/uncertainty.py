"""How well a frame shows where the anchors are: the covariance of its pose.

Near its minimum the energy E(x) = |r(x)|^2 of the match solver is (x - x0)^T H (x - x0), with the
Gauss-Newton matrix H = sum of J^T J over matches and regularizers. Read as a negative log posterior
it gives the covariance

    C = s^2 H^-1,    s = noise_px / (object_px sqrt(n))

s is the standard deviation of unit weight: E holds the weighted *mean* of squared match errors in
object sizes, and n independent matches with an error of `noise_px` have n / noise_px^2 as much
information. The regularizers keep the weight that they have against the matches in the solver: they
are the prior. (Triggs, McLauchlan, Hartley, Fitzgibbon, "Bundle Adjustment - A Modern Synthesis",
2000, section 4; Förstner, Wrobel, "Photogrammetric Computer Vision", 2016, section 4.2.3.)

What no match holds, directly or through its neighbors, is nearly free in H: its figures are large.
Nothing is ever less certain than `FARTHEST_SHIFT`, so all are finite.
"""

import dataclasses

import numpy as np
import torch

from animator.deform.gauss_newton import MatchProblem, MatchSolverConfig, information_at
from animator.types import AnchorPoses, AnchorUncertainty

FARTHEST_SHIFT = 1.0
"""Standard deviation of a place that nothing is known of [diagonals]."""
FARTHEST_TURN_RAD = np.pi
"""Standard deviation of a rotation that nothing is known of [rad]."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class MatchNoise:
    """How wrong matches are."""

    hidden_px: float = 0.5
    """Standard deviation, by coordinate, that the residuals do not show: the pose follows it [px]."""
    alike_within_px: float = 16.0
    """Matches nearer to each other than this err alike, for the matcher compares windows: such a
    neighborhood counts as one match [px]."""


STANDARD_NOISE = MatchNoise()
"""Of the project's matchers."""


def estimate_uncertainty(
    problem: MatchProblem,
    poses: AnchorPoses,
    config: MatchSolverConfig,
    *,
    residual_px: float = 0.0,
    noise: MatchNoise = STANDARD_NOISE,
) -> AnchorUncertainty:
    """Estimate how well the matches of a frame determine the place of each anchor.

    From the covariance C (see the module) of an anchor's translation, a 3x3 block, and the unit
    viewing ray d from the camera to the anchor: along the ray sqrt(d^T C d), across it
    sqrt((trace C - d^T C d) / 2), the root mean square over the two directions normal to d.

    Args:
        problem: The frame's matches and camera; without matches only the priors hold the pose.
        poses: The frame's final pose.
        config: Weights of the energy.
        residual_px: Standard deviation of the match residuals at the pose, by coordinate [px].
        noise: How wrong matches are beyond their residuals.

    Returns:
        Standard deviations by anchor; proportional to the pixel noise, up to `FARTHEST_SHIFT`.
    """
    noise_px = float(np.hypot(noise.hidden_px, residual_px))
    count = max(_independent_matches(problem, noise.alike_within_px), 1)
    unit_weight = noise_px / (problem.object_px * np.sqrt(count))
    covariances = _shift_covariances(problem, poses, config, unit_weight)

    places = (problem.anchors.positions + poses.translations).detach().cpu().numpy()
    rays = places.astype(np.float64) - problem.camera.position
    rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
    along = np.einsum("ai,aij,aj->a", rays, covariances, rays)
    across = (np.einsum("aii->a", covariances) - along) / 2
    return AnchorUncertainty(
        along_ray=np.sqrt(along).astype(np.float32),
        across_ray=np.sqrt(np.maximum(across, 0.0)).astype(np.float32),
    )


def _independent_matches(problem: MatchProblem, alike_within_px: float) -> int:
    """Count the cells of the image that hold matches."""
    targets = [matches.target_px for matches, weight in problem.terms if weight > 0]
    places = np.concatenate([np.zeros((0, 2)), *targets])
    return len(np.unique(np.floor(places / alike_within_px), axis=0))


def _shift_covariances(
    problem: MatchProblem, poses: AnchorPoses, config: MatchSolverConfig, unit_weight: float
) -> np.ndarray:
    """Return the covariance of each anchor's translation [scene unit squared], shape (A, 3, 3)."""
    normal = information_at(problem, poses, config)
    farthest = np.repeat([FARTHEST_TURN_RAD, FARTHEST_SHIFT * problem.diagonal], 3)
    np.einsum("ii->i", normal)[...] += np.tile((unit_weight / farthest) ** 2, len(problem.anchors))
    # torch's Cholesky, as in the solver: OpenBLAS threads stall for seconds on a busy machine.
    factor = torch.linalg.cholesky(torch.from_numpy(normal))
    inverse = torch.cholesky_inverse(factor).numpy().reshape(len(problem.anchors), 6, -1, 6)
    return unit_weight**2 * np.einsum("aiaj->aij", inverse)[:, 3:, 3:]
