import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from animator.deform import normals as module
from animator.deform.normals import surface_normals


def test_a_sheet_has_its_normal_everywhere():
    rng = np.random.default_rng(0)
    sheet = np.column_stack([rng.random((800, 2)), 0.002 * rng.standard_normal(800)])
    turn = Rotation.from_euler("xyz", [20, 50, -30], degrees=True)
    normals = surface_normals(turn.apply(sheet) + 7.0)
    along = np.abs(normals.directions @ turn.apply([0.0, 0.0, 1.0]))
    assert along.min() > 0.99
    assert (normals.trusts == 1.0).all()
    np.testing.assert_allclose(np.linalg.norm(normals.directions, axis=1), 1.0)


def test_a_lump_has_no_surface():
    rng = np.random.default_rng(0)
    normals = surface_normals(rng.standard_normal((300, 3)))
    assert np.median(normals.trusts) == 0.0


def test_three_points_are_no_surface():
    normals = surface_normals(np.eye(3))
    assert (normals.trusts == 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(normals.directions, axis=1), 1.0)


def test_however_many_at_once_they_are_the_same(monkeypatch: pytest.MonkeyPatch):
    points = np.random.default_rng(0).standard_normal((500, 3))
    together = surface_normals(points)
    monkeypatch.setattr(module, "_CHUNK", 64)
    apart = surface_normals(points)
    np.testing.assert_array_equal(apart.trusts, together.trusts)
    np.testing.assert_array_equal(apart.directions, together.directions)
