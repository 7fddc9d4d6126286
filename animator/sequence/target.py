"""One frame as the solvers see it: on black, cropped to the object, with its size in the image."""

import dataclasses

import numpy as np
import torch

from animator.deform.frame_target import FrameTarget
from animator.deform.image_difference import ImageOnBlack
from animator.match.protocol import MaskedImage
from animator.types import Camera, Frames

_MARGIN = 0.12
"""Room around the object in the crop [object sizes]: how far it may move in one step and stay inside."""
_TILE_PX = 16
"""Crops are whole tiles of the renderer."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Window:
    """A rectangle of the image [px]."""

    left: int
    top: int
    width: int
    height: int

    @classmethod
    def of_all(cls, camera: Camera) -> "Window":
        """Return the window that is the whole image."""
        return cls(left=0, top=0, width=camera.width_px, height=camera.height_px)

    def cut(self, image: np.ndarray) -> np.ndarray:
        """Return the window's part of an image, shape (H, W) or (H, W, C)."""
        return image[self.top : self.top + self.height, self.left : self.left + self.width]

    def of(self, camera: Camera) -> Camera:
        """Return the camera that sees only this window."""
        return camera.cropped(self.left, self.top, self.width, self.height)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FrameView:
    """One frame and its coverage."""

    rgb: np.ndarray
    """sRGB, straight, uint8, shape (H, W, 3)."""
    alpha: np.ndarray
    """Coverage, uint8, shape (H, W)."""

    @classmethod
    def read(cls, frames: Frames, index: int) -> "FrameView":
        """Take one frame of the clip."""
        return cls(rgb=frames.images[index], alpha=frames.alphas[index])

    def target(self, window: Window, camera: Camera, device: torch.device) -> FrameTarget:
        """Return the part of the frame in a window, composited on black, on the renderer's device."""
        rgb, alpha = self._cut(window)
        coverage = torch.from_numpy(alpha.astype(np.float32) / 255.0)
        color = torch.from_numpy(rgb.astype(np.float32) / 255.0) * coverage[..., None]
        return FrameTarget(
            image=ImageOnBlack(rgb=color.to(device), alpha=coverage.to(device)),
            camera=window.of(camera),
            matches=None,
            object_px=object_size_px(alpha > 127),
        )

    def masked(self, window: Window | None = None) -> MaskedImage:
        """Return the frame, or the part of it in a window, for matching."""
        rgb, alpha = (self.rgb, self.alpha) if window is None else self._cut(window)
        return MaskedImage(rgb=np.ascontiguousarray(rgb), mask=alpha > 127)

    def _cut(self, window: Window) -> tuple[np.ndarray, np.ndarray]:
        return window.cut(self.rgb), window.cut(self.alpha)


def halved(target: FrameTarget) -> FrameTarget:
    """Return a frame at half its size, each pixel the mean of four, without its matches and depths."""
    planes = torch.cat([target.image.rgb, target.image.alpha[..., None]], dim=-1).movedim(-1, 0)
    means = torch.nn.functional.avg_pool2d(planes[None], 2)[0].movedim(0, -1)
    return FrameTarget(
        image=ImageOnBlack(rgb=means[..., :3].contiguous(), alpha=means[..., 3].contiguous()),
        camera=target.camera.halved(),
        matches=None,
        object_px=target.object_px / 2.0,
    )


def object_size_px(mask: np.ndarray) -> float:
    """Measure the diagonal of the mask's bounding box [px], at least 1."""
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        return float(np.hypot(*mask.shape))
    return max(float(np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1)), 1.0)


def silhouette_iou(first: np.ndarray, second: np.ndarray) -> float:
    """Return the intersection over the union of two masks; 1 if both are empty."""
    union = int((first | second).sum())
    return int((first & second).sum()) / union if union else 1.0


def crop_window(view: FrameView, render_alpha: torch.Tensor, camera: Camera) -> Window:
    """Enclose the frame's object and the render's, with room to move, in whole tiles."""
    mask = (view.alpha > 127) | (render_alpha.detach().cpu().numpy() > 0.05)
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        return Window.of_all(camera)
    margin = int(np.ceil(_MARGIN * object_size_px(mask))) + 4
    left, width = _snap(int(columns.min()), int(columns.max()), margin, camera.width_px)
    top, height = _snap(int(rows.min()), int(rows.max()), margin, camera.height_px)
    return Window(left=left, top=top, width=width, height=height)


def _snap(first: int, last: int, margin: int, size_px: int) -> tuple[int, int]:
    """Widen first..last by the margin to whole tiles inside the image. Returns start and length."""
    start = max(first - margin, 0)
    length = -(-(min(last + 1 + margin, size_px) - start) // _TILE_PX) * _TILE_PX
    length = min(length, size_px)
    return min(start, size_px - length), length


def masked_render(rgb: torch.Tensor, alpha: torch.Tensor) -> MaskedImage:
    """Turn a render on black into an image for matching."""
    color = (rgb.detach().cpu().numpy() * 255.0).round().clip(0, 255).astype(np.uint8)
    coverage = alpha.detach().cpu().numpy()
    return MaskedImage(rgb=color, mask=coverage > 0.5)
