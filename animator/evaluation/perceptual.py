"""Measures of what people see: FLIP, and LPIPS with weights that the user brings."""

import logging
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

logger = logging.getLogger(__name__)

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

        def flip(drawn: np.ndarray, true: np.ndarray) -> float:
            reference, test = (np.ascontiguousarray(image, np.float32) for image in (true, drawn))
            return float(flip_evaluator.evaluate(reference, test, "LDR", applyMagma=False)[1])

        judges["flip"] = flip
    if lpips_weights:
        from animator.evaluation.lpips import load_lpips

        judges["lpips"] = load_lpips(lpips_weights)
    return judges
