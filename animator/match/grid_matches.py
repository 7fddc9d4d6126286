"""Sparse matches read off a dense flow."""

import numpy as np

from animator.match.protocol import FlowField
from animator.types import Matches

STRIDE_PX = 4
"""Distance between neighbouring matches [px]."""


def grid_matches(flow: FlowField, *, stride_px: int = STRIDE_PX) -> Matches:
    """Read the trusted displacements of a flow on a regular grid.

    Args:
        flow: The dense motion.
        stride_px: Distance between neighbouring matches [px].

    Returns:
        One match for each trusted grid pixel, in row order.
    """
    start = stride_px // 2
    confidences = flow.confidences[start::stride_px, start::stride_px]
    rows, columns = np.nonzero(confidences)
    source = np.stack([columns, rows], axis=-1).astype(np.float32) * stride_px + (start + 0.5)
    displacements = flow.flow_px[start::stride_px, start::stride_px][rows, columns]
    return Matches(
        source_px=source,
        target_px=source + displacements,
        confidences=confidences[rows, columns],
    )
