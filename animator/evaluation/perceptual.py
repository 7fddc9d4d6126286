"""Measures of what people see: FLIP, and LPIPS with weights that the user brings."""

import logging
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

logger = logging.getLogger(__name__)

_FLIP_REACH_PX = 24
"""More than the filters of FLIP reach at 67 pixels a degree, its standard: 10 px and 9 px after."""

Judge = Callable[[np.ndarray, np.ndarray], float]
"""Takes a drawn and a true picture, sRGB 0..1, float32, shape (H, W, 3); 0 is alike."""


def load_judges(lpips_weights: Sequence[Path] = ()) -> dict[str, Judge]:
    """Return the measures that can be had here, by name; say which cannot, and why.

    Args:
        lpips_weights: Files of the AlexNet and of the LPIPS layers; see `animator.evaluation.lpips`.

    Raises:
        InputError: If weights are given and do not fit.
    """
    judges: dict[str, Judge] = {}
    try:
        import flip_evaluator
    except ImportError:
        logger.warning("FLIP is left out: run pip install 'splatimate[evaluate]' to have it.")
    else:

        def whole(drawn: np.ndarray, true: np.ndarray) -> float:
            true, drawn = (np.ascontiguousarray(image, np.float32) for image in (true, drawn))
            return float(flip_evaluator.evaluate(true, drawn, "LDR", applyMagma=False)[1])

        judges["flip"] = lambda drawn, true: _where_not_black(whole, drawn, true)
    if lpips_weights:
        from animator.evaluation.lpips import load_lpips

        judges["lpips"] = load_lpips(lpips_weights)
    return judges


def _where_not_black(judge: Judge, drawn: np.ndarray, true: np.ndarray) -> float:
    """Average over the whole pictures, but look only where one is not black: elsewhere it is zero."""
    rows, columns = np.nonzero((drawn + true).any(axis=2))
    if len(rows) == 0:
        return 0.0
    window = tuple(
        slice(max(int(at.min()) - _FLIP_REACH_PX, 0), int(at.max()) + 1 + _FLIP_REACH_PX)
        for at in (rows, columns)
    )
    share = drawn[window].size / drawn.size
    return share * judge(drawn[window], true[window])
