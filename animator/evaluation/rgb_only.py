"""The plainest baseline: every Gaussian moves freely to make the picture right (the paper's "3DGS").

No rig, no matches, nothing that holds neighbors together. It reaches nearly any picture of the
clip's own camera, and shows from the side what a picture alone does not say.
"""

import dataclasses
import logging
from collections.abc import Callable

import numpy as np
import torch

from animator import quaternions
from animator.deform import losses
from animator.evaluation.motion import Motion
from animator.render.protocol import Renderer
from animator.scene import Scene
from animator.sequence.target import FrameView, crop_window
from animator.sequence.view_colors import ViewColors
from animator.threads import same_bytes_on_any_threads
from animator.types import Camera, Gaussians

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class RgbOnlyConfig:
    """The optimizer, as that of the image stage, without its preconditioner."""

    iterations: int = 100
    """Adam steps a frame; more, or larger ones, only make the held-out views worse."""
    turn_rate: float = 4e-3
    """Learning rate of the quaternions."""
    shift_rate: float = 1e-3
    """Learning rate of the centers [diagonals]."""
    final_rate: float = 0.1
    """Share of the learning rate left at the last step."""


@same_bytes_on_any_threads()
def fit_rgb_only(
    scene: Scene,
    cameras: tuple[Camera, ...],
    renderer: Renderer,
    config: RgbOnlyConfig,
    on_frame: Callable[[int], None] = lambda index: None,
) -> Motion:
    """Follow the frames with free Gaussians, each frame from the one before.

    Args:
        scene: Gaussians and frames; the first shows them at rest.
        cameras: One a frame.
        renderer: Draws them.
        config: The optimizer.
        on_frame: Called with the index of each finished frame.
    """
    rest = scene.gaussians.to(renderer.device)
    colors = ViewColors()
    posed, found = rest, [rest]
    for index in range(1, len(scene.frames)):
        view = FrameView.read(scene.frames, index)
        colors.look(posed, cameras[index])
        posed = _fit_frame(posed, view, cameras[index], renderer, colors, config, rest.diagonal)
        found.append(posed)
        on_frame(index)
    return Motion(
        gaussians=scene.gaussians,
        numbers=scene.frames.numbers,
        positions=np.stack([gaussians.means.cpu().numpy() for gaussians in found]),
        quats_wxyz=np.stack([gaussians.quats_wxyz.cpu().numpy() for gaussians in found]),
    )


def _fit_frame(
    start: Gaussians,
    view: FrameView,
    camera: Camera,
    renderer: Renderer,
    colors: ViewColors,
    config: RgbOnlyConfig,
    diagonal: float,
) -> Gaussians:
    with torch.no_grad():
        alpha = renderer.render(colors.paint(start), camera).alpha
    target = view.target(crop_window(view, alpha, camera), camera, renderer.device)
    turns = torch.zeros_like(start.quats_wxyz).requires_grad_()
    shifts = torch.zeros_like(start.means).requires_grad_()
    optimizer = torch.optim.Adam(
        [
            {"params": [turns], "lr": config.turn_rate},
            {"params": [shifts], "lr": config.shift_rate},
        ],
        betas=(0.9, 0.99),
    )
    decay = torch.optim.lr_scheduler.ExponentialLR(
        optimizer, config.final_rate ** (1.0 / max(config.iterations, 1))
    )

    def moved() -> Gaussians:
        quats = quaternions.normalize(start.quats_wxyz + turns)
        return start.posed(start.means + shifts * diagonal, quats)

    for _ in range(config.iterations):
        optimizer.zero_grad()
        rgb = renderer.render(colors.paint(moved()), target.camera).rgb
        losses.rgb_loss(rgb, target.image.rgb, area_px=target.image.area_px).backward()
        optimizer.step()
        decay.step()
    with torch.no_grad():
        return moved()
