"""Draw every solved frame once: its figures, and the pictures of some."""

import dataclasses
from collections.abc import Iterator
from typing import Protocol

import numpy as np
import torch

from animator.deform.skinning import Skinner
from animator.render.protocol import Renderer
from animator.render.spherical_harmonics import SH_C0
from animator.report import quality
from animator.report.palette import group_colors
from animator.report.quality import FrameQuality
from animator.sequence.solved_frame import SolvedFrame
from animator.types import Anchors, Camera, Frames, Gaussians
from exporters.clip import Clip


class FinishedFit(Protocol):
    """What is measured; `animator.pipeline.Fit` is one."""

    @property
    def clip(self) -> Clip:
        """The baked clip."""
        ...

    @property
    def gaussians(self) -> Gaussians:
        """The rest pose, on the renderer's device."""
        ...

    @property
    def anchors(self) -> Anchors:
        """The rig."""
        ...

    @property
    def solved(self) -> tuple[SolvedFrame, ...]:
        """One pose a frame."""
        ...

    @property
    def renderer(self) -> Renderer:
        """Draws the poses."""
        ...


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FramePictures:
    """What the eye needs to judge one frame; all uint8, on black, shape (H, W, 3)."""

    number: int
    """The original frame number."""
    frame: np.ndarray
    """The frame, masked."""
    render: np.ndarray
    """The posed Gaussians."""
    difference: np.ndarray
    """Absolute difference of the two."""
    groups: np.ndarray
    """The Gaussians in the colors of their rigid groups."""
    is_object: np.ndarray
    """Union of both silhouettes, bool, shape (H, W)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Measurement:
    """The result of measuring one frame."""

    quality: FrameQuality
    pictures: FramePictures | None
    """Only of the frames that were asked for."""


def measure(fit: FinishedFit, frames: Frames, *, picture_count: int = 8) -> Iterator[Measurement]:
    """Measure frame after frame.

    Args:
        fit: The finished fit.
        frames: What it was fitted to, one a solved frame.
        picture_count: How many frames, evenly chosen, to return pictures of.

    Yields:
        One measurement a frame, in order.
    """
    gaussians = fit.gaussians
    diagonal = gaussians.diagonal
    rest = _array(gaussians.means)
    opacities = _array(gaussians.opacities)
    skinner = Skinner(fit.anchors, gaussians.means, gaussians.quats_wxyz)
    key_times_s = _solved_times_s(fit.clip, len(fit.solved))
    with_pictures = evenly_chosen(len(frames), picture_count)
    ever_seen = np.zeros(len(gaussians), bool)
    for index, solved in enumerate(fit.solved):
        with torch.no_grad():
            posed = gaussians.posed(*skinner(solved.poses))
            rgb, alpha = _draw(fit.renderer, posed, solved.camera)
            visibility = fit.renderer.visibility(posed, solved.camera)
        coverage = frames.alphas[index].astype(np.float32) / 255.0
        frame_rgb = frames.images[index].astype(np.float32) / 255.0 * coverage[..., None]
        frame_mask, render_mask = coverage > quality.SOLID_ALPHA, alpha > quality.SOLID_ALPHA
        is_seen = visibility.visible_shares > quality.SEEN_SHARE
        ever_seen |= is_seen
        means = _array(posed.means)
        skinned = fit.clip.pose_at(key_times_s[index]).positions
        residual = quality.rigid_residual(rest, means, solved.groups.labels)
        figures = FrameQuality(
            psnr_db=quality.masked_psnr_db(rgb, frame_rgb, frame_mask | render_mask),
            silhouette_iou=quality.silhouette_iou(frame_mask, render_mask),
            rigid_residual_percent=100 * residual / diagonal,
            skin_error_percent=100 * quality.largest_distance(skinned, means) / diagonal,
            unseen_share=quality.weighted_share(~is_seen, opacities),
            never_seen_share=quality.weighted_share(~ever_seen, opacities),
            **_uncertainty(solved, diagonal),
        )
        pictures = None
        if index in with_pictures:
            pictures = FramePictures(
                number=frames.numbers[index],
                frame=_bytes(frame_rgb),
                render=_bytes(rgb),
                difference=_bytes(np.abs(rgb - frame_rgb)),
                groups=_bytes(_draw_groups(fit.renderer, posed, solved)),
                is_object=frame_mask | render_mask,
            )
        yield Measurement(quality=figures, pictures=pictures)


def evenly_chosen(total: int, count: int) -> tuple[int, ...]:
    """Return at most `count` positions of 0..total-1, evenly spaced, first and last among them."""
    if count < 1 or total < 1:
        return ()
    return tuple(sorted({round(k) for k in np.linspace(0, total - 1, min(count, total))}))


def _solved_times_s(clip: Clip, solved_count: int) -> np.ndarray:
    """Return the times of the keys that were solved, leaving the in-betweens out."""
    is_solved = np.array([number >= 0 for number in clip.source_frames], bool)
    times_s = clip.tracks.times_s[is_solved] if len(is_solved) else clip.tracks.times_s
    assert len(times_s) == solved_count, "a clip has one key a solved frame"
    return times_s


def _uncertainty(solved: SolvedFrame, diagonal: float) -> dict[str, quality.Spread]:
    known = solved.uncertainty
    if known is None:
        return {}
    return {
        "uncertainty_along_percent": quality.Spread.of(100 * known.along_ray / diagonal),
        "uncertainty_across_percent": quality.Spread.of(100 * known.across_ray / diagonal),
    }


def _draw(
    renderer: Renderer, gaussians: Gaussians, camera: Camera
) -> tuple[np.ndarray, np.ndarray]:
    rendering = renderer.render(gaussians, camera)
    return _array(rendering.rgb).clip(0.0, 1.0), _array(rendering.alpha)


def _draw_groups(renderer: Renderer, posed: Gaussians, solved: SolvedFrame) -> np.ndarray:
    colors = group_colors(solved.groups.labels)
    flat = torch.as_tensor((colors - 0.5) / SH_C0, dtype=torch.float32)[:, None]
    colored = dataclasses.replace(posed, sh_coeffs=flat.to(posed.means.device))
    with torch.no_grad():
        return _draw(renderer, colored, solved.camera)[0]


def _bytes(rgb: np.ndarray) -> np.ndarray:
    return np.rint(rgb * 255.0).astype(np.uint8)


def _array(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().cpu().numpy()
