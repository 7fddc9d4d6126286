"""Learns the light of a clip from the frames that are solved: how brightness changed where surfaces turned."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch

from animator.deform.image_difference import ImageOnBlack
from animator.deform.image_solver import ImageSolver
from animator.deform.light_fit import LightFit, LightSamples
from animator.match.sampling import values_at
from animator.render.protocol import Renderer
from animator.sequence.sight import Sight
from animator.sequence.solved_frame import SolvedFrame


@dataclasses.dataclass(frozen=True, kw_only=True)
class LightStageConfig:
    """What is expected of a light, and which Gaussians are asked."""

    spread: float = 0.15
    """Standard deviation of the light that is expected [natural logarithm of color]; 0 switches it off."""
    noise: float = 0.05
    """Error of a brightness, likewise."""
    alike: float = 50.0
    """Gaussians whose errors are alike."""
    blur_px: float = 1.5
    """Brightness is compared after a blur of this standard deviation [px]: edges never lie exactly right."""
    least_visible: float = 0.3
    """Share of a Gaussian that must be visible."""
    least_flat: float = 0.5
    """Trust in its normal."""
    least_covered: float = 0.97
    """Coverage around it, drawn and seen."""
    most_hue: float = 0.05
    """Change of the color's proportions, above which another surface is seen there."""
    darkest: float = 0.03
    """Brightness below which a ratio says nothing, 0..1."""


class LightStage:
    """Keeps the light of the sight up to date."""

    def __init__(
        self, image_solver: ImageSolver, renderer: Renderer, sight: Sight, config: LightStageConfig
    ) -> None:
        self._image_solver = image_solver
        self._renderer = renderer
        self._sight = sight
        self._config = config
        self._fit: LightFit | None = None

    def learn_afresh(self, solved: Sequence[SolvedFrame]) -> None:
        """Forget the light, and learn it from some frames in order, the first of the clip first."""
        config = self._config
        if config.spread == 0.0:
            return
        self._fit = LightFit(spread=config.spread, noise=config.noise, alike=config.alike)
        self._light_up()
        for index, frame in enumerate(solved):
            self.learn(index, frame)

    def learn(self, index: int, frame: SolvedFrame) -> None:
        """Learn from another frame; one that shows what the one before it showed says nothing new."""
        if self._fit is None or frame.is_held:
            return
        self._fit.add(self._samples(index, frame))
        self._light_up()

    def _light_up(self) -> None:
        """Show the sight the light that is known by now."""
        assert self._fit is not None
        shading = self._sight.shading
        shading.light = torch.from_numpy(self._fit.light).to(shading.trusts)

    def _samples(self, index: int, frame: SolvedFrame) -> LightSamples:
        config, shading = self._config, self._sight.shading
        with torch.no_grad():
            posed = self._image_solver.pose(frame.poses)
            target = self._sight.look(index, posed, frame.camera)[1]
            rgb, alpha = self._sight.draw(posed, target.camera)
            normal_changes = shading.normal_changes(posed)
            known = shading.log_gains(posed)
        seen = self._renderer.visibility(posed, target.camera)
        ratios = _log_ratios(ImageOnBlack(rgb=rgb, alpha=alpha), target.image, config)
        log_ratios = values_at(ratios, seen.centres_px, outside=np.nan).astype(np.float64)
        if known is not None:  # It was drawn in that light: what it did is added again.
            log_ratios += known.cpu().numpy()
        is_usable = np.isfinite(log_ratios) & (seen.visible_shares > config.least_visible)
        is_usable &= shading.trusts.cpu().numpy() > config.least_flat
        return LightSamples(
            normal_changes=normal_changes.cpu().numpy()[is_usable].astype(np.float64),
            log_ratios=log_ratios[is_usable],
        )


def _log_ratios(drawn: ImageOnBlack, shown: ImageOnBlack, config: LightStageConfig) -> np.ndarray:
    """Compare the brightness of a frame with what is drawn.

    Returns:
        Natural logarithms, NaN at edges and where another surface is seen, shape (H, W).
    """
    drawn_rgb, drawn_alpha = _blurred(drawn, config.blur_px)
    shown_rgb, shown_alpha = _blurred(shown, config.blur_px)
    hue_change = np.abs(_proportions(shown_rgb) - _proportions(drawn_rgb)).sum(axis=-1)
    is_same = np.minimum(drawn_alpha, shown_alpha) > config.least_covered
    is_same &= hue_change < config.most_hue
    brightness = [rgb.mean(axis=-1).clip(config.darkest) for rgb in (drawn_rgb, shown_rgb)]
    return np.where(is_same, np.log(brightness[1] / brightness[0]), np.nan)


def _blurred(image: ImageOnBlack, sigma_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Return color, shape (H, W, 3), and coverage, shape (H, W), after a blur."""
    import cv2

    planes = torch.cat([image.rgb, image.alpha[..., None]], dim=-1)
    blurred = cv2.GaussianBlur(planes.cpu().numpy(), (0, 0), sigma_px)
    return blurred[..., :3], blurred[..., 3]


def _proportions(rgb: np.ndarray) -> np.ndarray:
    """Return each color's channels as shares of their sum."""
    return rgb / rgb.sum(axis=-1, keepdims=True).clip(1e-6)
