"""Does what claims to be uncertain err more? Spearman's rank correlation."""

import numpy as np


def correlation(errors: np.ndarray, uncertainties: np.ndarray) -> float:
    """Correlate the ranks of errors with those of their claimed uncertainties.

    Args:
        errors: True errors, any shape.
        uncertainties: What the method said of them, same shape and order; any unit, for only the
            order counts. NaN where it said nothing.

    Returns:
        Spearman's rho: 1 if they rise together, 0 if they have nothing to do with each other; NaN
        if fewer than two pairs can be compared, or one side is constant.
    """
    from scipy.stats import rankdata

    is_known = np.isfinite(errors) & np.isfinite(uncertainties)
    if is_known.sum() < 2:
        return float("nan")
    first = rankdata(errors[is_known])
    second = rankdata(uncertainties[is_known])
    first -= first.mean()
    second -= second.mean()
    norms = np.linalg.norm(first) * np.linalg.norm(second)
    return float(first @ second / norms) if norms > 0 else float("nan")
