"""Collect decoded pictures in one block of memory, without ever holding them twice."""

import numpy as np

from animator.errors import InputError
from animator.scene.image_file import Picture

_MAX_BYTES = 8 * 2**30
"""Colors and coverage of all selected frames."""
_BYTES_PER_PIXEL = 4


class FrameStack:
    """Pictures of one size; grows, because videos are not sure of their length."""

    def __init__(self, where: str, expected_count: int):
        self._where = where
        self._expected_count = max(1, expected_count)
        self._images = np.zeros((0, 0, 0, 3), np.uint8)
        self._alphas = np.zeros((0, 0, 0), np.uint8)
        self.names: list[str] = []

    def __len__(self) -> int:
        return len(self.names)

    def append(self, picture: Picture) -> None:
        """Add a picture.

        Raises:
            InputError: If the pictures take more memory than a run may use.
        """
        count = len(self)
        if count == len(self._images):
            self._reserve(picture)
        self._images[count] = picture.rgb
        self._alphas[count] = picture.alpha
        self.names.append(picture.name)

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Return images, shape (T, H, W, 3), and alphas, shape (T, H, W)."""
        return self._images[: len(self)], self._alphas[: len(self)]

    def _reserve(self, picture: Picture) -> None:
        width_px, height_px = picture.size_px
        most = _MAX_BYTES // (_BYTES_PER_PIXEL * width_px * height_px)
        count = len(self)
        if count >= most:
            raise InputError(
                f"{self._where}: more than {most} frames of {width_px}x{height_px} pixels do not "
                f"fit into {_MAX_BYTES / 2**30:.0f} GiB; keep fewer (--every N, --frames 0,6,12) "
                "or smaller ones."
            )
        # The expected count suffices but for videos that are longer than they promise. Untouched
        # memory costs nothing, so a promise that is too large does no harm.
        capacity = min(most, max(self._expected_count, count + count // 4 + 1))
        images = np.empty((capacity, height_px, width_px, 3), np.uint8)
        alphas = np.empty((capacity, height_px, width_px), np.uint8)
        if count:
            images[:count], alphas[:count] = self._images, self._alphas
        self._images, self._alphas = images, alphas
