"""Claims of one frame: moves what lost its pixels to the pixels that nothing explains."""

import dataclasses

import numpy as np
import torch

from animator.deform.frame_target import FrameTarget
from animator.deform.image_solver import Draw, ImageSolver
from animator.match.claims import ClaimConfig, DrawnGaussians, find_claims
from animator.match.unexplained import CoveredImage
from animator.render.protocol import Renderer
from animator.sequence.match_stage import MatchedPose, MatchStage
from animator.sequence.view_colors import ViewColors
from animator.types import AnchorPoses, GaussianMatches


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClaimStageConfig:
    """How claims are followed."""

    rounds: int = 4
    """Rounds of render, claim, solve; 0 switches claims off."""
    weight: float = 0.3
    """Weight of the claims beside the frame's matches."""
    gain: float = 0.01
    """Share of the frame's energy that the claims must save to be believed."""
    claims: ClaimConfig = dataclasses.field(default_factory=ClaimConfig)


class ClaimStage:
    """Follows the claims of frame after frame for one clip."""

    def __init__(
        self,
        image_solver: ImageSolver,
        match_stage: MatchStage,
        renderer: Renderer,
        draw: Draw,
        colors: ViewColors,
        config: ClaimStageConfig,
    ) -> None:
        self._image_solver = image_solver
        self._match_stage = match_stage
        self._renderer = renderer
        self._draw = draw
        self._colors = colors
        self._config = config

    def solve(
        self,
        start: AnchorPoses,
        matched: MatchedPose,
        target: FrameTarget,
        previous: AnchorPoses,
        rng: np.random.Generator,
    ) -> AnchorPoses | None:
        """Follow the claims from `start`, round by round, held by the frame's matches.

        Returns:
            The best pose found if it is clearly better than `start`, else None.
        """
        goal = dataclasses.replace(target, matches=matched.matches)
        start_energy = best_energy = self._image_solver.energy(start, goal, previous)
        poses = best = start
        for _ in range(self._config.rounds):
            claims = self._find(poses, target, rng)
            if claims is None:
                break
            terms = ((matched.matches, 1.0), (claims, self._config.weight))
            poses = self._match_stage.solve_terms(target, terms, poses, previous)
            energy = self._image_solver.energy(poses, goal, previous)
            if energy < best_energy:
                best, best_energy = poses, energy
        return best if best_energy < (1.0 - self._config.gain) * start_energy else None

    def _find(
        self, poses: AnchorPoses, target: FrameTarget, rng: np.random.Generator
    ) -> GaussianMatches | None:
        posed = self._image_solver.pose(poses)
        with torch.no_grad():
            rgb, alpha = self._draw(posed, target.camera)
        seen = self._renderer.visibility(posed, target.camera)
        drawn = DrawnGaussians(
            centers_px=seen.centres_px,
            depths=seen.depths,
            visible_shares=seen.visible_shares,
            opacities=posed.opacities.cpu().numpy(),
            colors=self._colors.base_colors(posed).cpu().numpy(),
        )
        return find_claims(
            CoveredImage.of(rgb, alpha),
            CoveredImage.of(target.image.rgb, target.image.alpha),
            drawn,
            target.object_px,
            self._config.claims,
            rng,
        )
