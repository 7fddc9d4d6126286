"""The capture's views, as the frame's lens would see them."""

import dataclasses
import logging
from collections.abc import Sequence

import numpy as np

from animator.match.protocol import MaskedImage
from animator.types import Camera

_ASPECT_TOLERANCE = 0.02

_log = logging.getLogger(__name__)


def spread_cameras(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """Choose at most `count` cameras, each as far as possible from those chosen before it."""
    if len(cameras) <= count:
        return list(cameras)
    _log.info("camera search: %d of %d capture views are looked at", count, len(cameras))
    positions = np.stack([camera.position for camera in cameras])
    chosen = [0]
    distances = np.linalg.norm(positions - positions[0], axis=1)
    while len(chosen) < count:
        chosen.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(positions - positions[chosen[-1]], axis=1))
    return [cameras[index] for index in sorted(chosen)]


def at_frame(
    camera: Camera, width_px: int, height_px: int, intrinsics: np.ndarray | None
) -> Camera:
    """Return a capture camera with the frame's size and lens.

    The lens is scaled by the ratio of the longer sides, so that a phone turned upright keeps its
    focal length; the principal point keeps its offset from the image center.
    """
    if intrinsics is None:
        scale = max(width_px, height_px) / max(camera.width_px, camera.height_px)
        offset = camera.intrinsics[:2, 2] - np.array([camera.width_px, camera.height_px]) / 2
        intrinsics = np.array(camera.intrinsics, np.float64)
        intrinsics[:2] *= scale
        intrinsics[:2, 2] = np.array([width_px, height_px]) / 2 + scale * offset
    return dataclasses.replace(
        camera,
        intrinsics=np.asarray(intrinsics, np.float64),
        width_px=width_px,
        height_px=height_px,
    )


def warn_of_other_aspect(camera: Camera, width_px: int, height_px: int) -> None:
    """Say once that the frame has another shape than the capture's images."""
    ratio = width_px * camera.height_px / (height_px * camera.width_px)
    if abs(ratio - 1) > _ASPECT_TOLERANCE:
        _log.warning(
            "the capture is %d x %d, the frame %d x %d; the longer side sets the focal length",
            camera.width_px,
            camera.height_px,
            width_px,
            height_px,
        )


def resized(camera: Camera, shape: tuple[int, ...]) -> Camera:
    """Return the camera of the same image at another resolution, shape (H, W)."""
    height, width = shape
    intrinsics = np.array(camera.intrinsics, np.float64)
    # With pixel centres at +0.5 the image's edges are at 0 and W, so scaling is all there is to do.
    intrinsics[0] *= width / camera.width_px
    intrinsics[1] *= height / camera.height_px
    return dataclasses.replace(camera, intrinsics=intrinsics, width_px=width, height_px=height)


def shrunk(image: MaskedImage, max_side_px: int) -> MaskedImage:
    """Return the image with its longer side at most this long."""
    import cv2

    height, width = image.mask.shape
    scale = max_side_px / max(height, width)
    if scale >= 1:
        return image
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    coverage = cv2.resize(image.mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return MaskedImage(
        rgb=cv2.resize(image.rgb, size, interpolation=cv2.INTER_AREA), mask=coverage > 0.5
    )
