"""Conversions at glTF's edge, each on a value that no symmetry can hide."""

import numpy as np

from exporters.gltf.order import column_major, xyzw


def test_xyzw_moves_the_real_part_last() -> None:
    converted = xyzw(np.array([0.5, 0.1, -0.7, 0.5]))
    np.testing.assert_allclose(converted, [0.1, -0.7, 0.5, 0.5], rtol=1e-6)
    assert converted.dtype == np.float32


def test_xyzw_normalizes() -> None:
    np.testing.assert_allclose(xyzw(np.array([[0.0, 0.0, 3.0, 4.0]])), [[0.0, 0.6, 0.8, 0.0]])


def test_column_major_puts_the_translation_last() -> None:
    matrix = np.array(
        [[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [9.0, 10.0, 11.0, 12.0], [0.0, 0.0, 1e-9, 1.0]]
    )
    expected = [1, 5, 9, 0, 2, 6, 10, 0, 3, 7, 11, 0, 4, 8, 12, 1]
    np.testing.assert_array_equal(column_major(matrix[None]), [expected])
