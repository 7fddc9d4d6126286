"""The part of the images that matchers look at: the object, at the size they were tuned for."""

import dataclasses

import numpy as np

from animator.match.protocol import FlowField, MaskedImage
from animator.match.sampling import inside_mask, pixel_centers

MARGIN_PX = 16
"""Room kept around the object's box, so that patches on its outline see some background."""
MIN_SIDE_PX = 320
"""Smaller objects are enlarged, at most twice: pixel constants were measured at 400 px."""
MAX_SIDE_PX = 1024
"""Larger objects are shrunk, which bounds time and memory on 4k frames."""
SIDE_MULTIPLE_PX = 32
"""XFeat resamples images whose sides are no multiple of this; padding avoids the shift."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Window:
    """A rectangle of an image and the resolution it is worked on at."""

    left_px: int
    """First column, in pixels of the whole image."""
    top_px: int
    """First row, in pixels of the whole image."""
    width_px: int
    """Width in pixels of the whole image."""
    height_px: int
    """Height in pixels of the whole image."""
    work_width_px: int
    """Width it is resampled to, before padding."""
    work_height_px: int
    """Height it is resampled to, before padding."""

    @property
    def scale(self) -> np.ndarray:
        """Working pixels per pixel, along x and y, float64, shape (2,)."""
        return np.array([self.work_width_px / self.width_px, self.work_height_px / self.height_px])

    def cut(self, image: MaskedImage) -> MaskedImage:
        """Return the window of an image, resampled, padded and gray off the object."""
        import cv2

        rows = slice(self.top_px, self.top_px + self.height_px)
        columns = slice(self.left_px, self.left_px + self.width_px)
        rgb = np.ascontiguousarray(image.rgb[rows, columns])
        mask = np.ascontiguousarray(image.mask[rows, columns])
        size = (self.work_width_px, self.work_height_px)
        if size != (self.width_px, self.height_px):
            shrinks = self.work_width_px < self.width_px
            method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
            # Averaged over the object only: the background must not bleed into its outline.
            weights = mask.astype(np.float32)
            coverage = cv2.resize(weights, size, interpolation=method)
            total = cv2.resize(rgb * weights[..., None], size, interpolation=method)
            rgb = np.rint(total / np.maximum(coverage, 1e-3)[..., None]).astype(np.uint8)
            mask = coverage > 0.5
        below = -self.work_height_px % SIDE_MULTIPLE_PX
        right = -self.work_width_px % SIDE_MULTIPLE_PX
        mask = np.pad(mask, ((0, below), (0, right)))
        rgb = np.pad(rgb, ((0, below), (0, right), (0, 0)))
        rgb[~mask] = 128
        return MaskedImage(rgb=rgb, mask=mask)

    def to_work(self, points_px: np.ndarray) -> np.ndarray:
        """Map positions of the whole image into the window, both with pixel centres at +0.5."""
        return (points_px - np.array([self.left_px, self.top_px])) * self.scale

    def to_image(self, points_px: np.ndarray) -> np.ndarray:
        """Map positions of the window into the whole image, both with pixel centres at +0.5."""
        return points_px / self.scale + np.array([self.left_px, self.top_px])

    def paste(self, work: FlowField, source: MaskedImage, target: MaskedImage) -> FlowField:
        """Return a flow of the window as one of the whole image, trusted from object to object."""
        import cv2

        flow = np.ascontiguousarray(work.flow_px[: self.work_height_px, : self.work_width_px])
        trust = np.ascontiguousarray(work.confidences[: self.work_height_px, : self.work_width_px])
        size = (self.width_px, self.height_px)
        if size != (self.work_width_px, self.work_height_px):
            flow = cv2.resize(flow, size, interpolation=cv2.INTER_LINEAR)
            # Nearest, so that the trust of accepted pixels does not leak onto rejected ones.
            trust = cv2.resize(trust, size, interpolation=cv2.INTER_NEAREST)
        rows = slice(self.top_px, self.top_px + self.height_px)
        columns = slice(self.left_px, self.left_px + self.width_px)
        pasted = untrusted_flow(source, work.matcher)
        pasted.flow_px[rows, columns] = flow / self.scale
        pasted.confidences[rows, columns] = trust
        # Resampling blurred the masks' outlines; here they are exact again.
        landing = pixel_centers(self.height_px, self.width_px) + pasted.flow_px[rows, columns]
        landing += np.array([self.left_px, self.top_px], np.float32)
        lands = inside_mask(target.mask, landing.reshape(-1, 2)).reshape(landing.shape[:2])
        pasted.confidences[rows, columns][~lands] = 0
        pasted.confidences[~source.mask] = 0
        return pasted


def window_around(*images: MaskedImage) -> Window | None:
    """Choose the window that holds the object of all given images.

    Args:
        images: Images of one size.

    Returns:
        The window, or None if one of the images has an empty mask.

    Raises:
        ValueError: If the images differ in size.
    """
    shapes = {image.mask.shape for image in images}
    if len(shapes) > 1:
        raise ValueError(
            f"source and target must have one size, got (height, width) {sorted(shapes)}: "
            "render at the frame's size, or scale the camera first"
        )
    if not all(image.mask.any() for image in images):
        return None
    height, width = images[0].mask.shape
    boxes = np.array([image.box_px for image in images])
    left, top = np.maximum(boxes[:, :2].min(axis=0) - MARGIN_PX, 0).tolist()
    right, bottom = np.minimum(boxes[:, 2:].max(axis=0) + MARGIN_PX, (width, height)).tolist()
    box_width, box_height = right - left, bottom - top
    scale = _work_scale(max(box_width, box_height))
    return Window(
        left_px=left,
        top_px=top,
        width_px=box_width,
        height_px=box_height,
        work_width_px=max(1, round(box_width * scale)),
        work_height_px=max(1, round(box_height * scale)),
    )


def _work_scale(side_px: int) -> float:
    if side_px > MAX_SIDE_PX:
        return MAX_SIDE_PX / side_px
    if side_px < MIN_SIDE_PX:
        return min(2.0, MIN_SIDE_PX / side_px)
    return 1.0


def untrusted_flow(source: MaskedImage, matcher: str) -> FlowField:
    """Return a flow that trusts nothing, writable."""
    height, width = source.mask.shape
    return FlowField(
        flow_px=np.zeros((height, width, 2), np.float32),
        confidences=np.zeros((height, width), np.float32),
        matcher=matcher,
    )
