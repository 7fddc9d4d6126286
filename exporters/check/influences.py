"""Rules for skin weights, the same in USD and glTF."""

from collections.abc import Iterator

import numpy as np

from exporters.check.problem import Problem, any_in_row, count_bad

WEIGHT_SUM_TOLERANCE = 1e-5
"""A vertex is off by at most this share of its distance from the origin: the error that the
exported skin may have at all."""


def joint_indices(place: str, joint_ids: np.ndarray, joint_count: int) -> Iterator[Problem]:
    """Every index names a joint, used or not (glTF 2.0, section 3.7.3.3; UsdSkelBindingAPI).

    Args:
        place: Where they are.
        joint_ids: Integers, one row a vertex, shape (V, K).
        joint_count: Number of joints they choose from.
    """
    yield from count_bad(
        place,
        any_in_row((joint_ids < 0) | (joint_ids >= joint_count)),
        expected=f"joints 0..{joint_count - 1}",
        what="vertices with another joint",
    )


def weights(place: str, weights: np.ndarray) -> Iterator[Problem]:
    """Weights are positive and sum to 1 (glTF 2.0, section 3.7.3.3); UsdSkel does not normalize.

    Args:
        place: Where they are.
        weights: One row a vertex, shape (V, K).
    """
    yield from count_bad(
        place, any_in_row(weights < 0), expected="weights >= 0", what="vertices with others"
    )
    # As a product: numpy sums short rows one by one, which is ten times slower.
    sums = weights @ np.ones(weights.shape[-1], np.float32)
    yield from count_bad(
        place,
        np.abs(sums - 1) > WEIGHT_SUM_TOLERANCE,
        expected="weights that sum to 1",
        what="vertices whose weights do not",
    )


def distinct_joints(place: str, joint_ids: np.ndarray, weights: np.ndarray) -> Iterator[Problem]:
    """No vertex follows a joint twice.

    glTF forbids it (2.0, section 3.7.3.3); UsdSkel adds the weights, Blender 5.0 keeps the last.

    Args:
        place: Where they are.
        joint_ids: Integers, one row a vertex, shape (V, K).
        weights: Their weights; those of weight 0 may repeat, shape (V, K).
    """
    # An unused influence gets a number of its own, below 0, so that only used ones can be equal.
    unused = -1 - np.arange(joint_ids.shape[-1])
    used = np.sort(np.where(weights > 0, joint_ids, unused), axis=-1)
    yield from count_bad(
        place,
        any_in_row((used[:, 1:] == used[:, :-1]) & (used[:, 1:] >= 0)),
        expected="different joints in a vertex",
        what="vertices that follow one joint twice",
    )
