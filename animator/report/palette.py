"""Colors of rigid groups that can be told apart."""

import numpy as np

UNGROUPED = (0.45, 0.45, 0.45)
"""Gray of Gaussians that belong to no group."""

_COLORS = np.array(
    [
        # Paul Tol's "bright" and "vibrant" schemes (technical note SRON/EPS/TN/09-002), without
        # their grays: distinct for color-blind readers too.
        (0x44, 0x77, 0xAA),
        (0xEE, 0x66, 0x77),
        (0x22, 0x88, 0x33),
        (0xCC, 0xBB, 0x44),
        (0x66, 0xCC, 0xEE),
        (0xAA, 0x33, 0x77),
        (0xEE, 0x77, 0x33),
        (0x00, 0x99, 0x88),
        (0xCC, 0x33, 0x11),
        (0x33, 0xBB, 0xEE),
    ]
)


def group_colors(labels: np.ndarray) -> np.ndarray:
    """Return a color for each Gaussian, sRGB 0..1, shape (N, 3).

    Args:
        labels: Group of each Gaussian, -1 for none, shape (N,); colors repeat after ten groups,
            darker.
    """
    groups = np.maximum(labels, 0)
    rounds = groups // len(_COLORS)
    colors = _COLORS[groups % len(_COLORS)] / 255.0 * (0.7 ** np.minimum(rounds, 3))[:, None]
    return np.where((labels >= 0)[:, None], colors, UNGROUPED)
