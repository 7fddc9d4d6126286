"""A frame in two halves like a chessboard: what is fitted to the one half can be judged by the other."""

from collections.abc import Iterator

import torch

from animator.deform.frame_target import FrameTarget


def halves(target: FrameTarget, cells: float) -> Iterator[tuple[FrameTarget, FrameTarget]]:
    """Cut a frame into square cells; show every other one and hide the rest, and the other way round.

    Args:
        target: The frame.
        cells: Cells along the object's size.

    Yields:
        What is shown and what is hidden, twice.
    """
    alpha = target.image.alpha
    size_px = max(round(target.object_px / cells), 1)
    rows, columns = (
        torch.div(torch.arange(count, device=alpha.device), size_px, rounding_mode="floor")
        for count in alpha.shape
    )
    white = ((rows[:, None] + columns[None]) % 2).to(alpha)
    for shown in (white, 1.0 - white):
        yield target.limited_to(shown), target.limited_to(1.0 - shown)
