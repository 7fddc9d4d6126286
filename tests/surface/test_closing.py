"""Torn meshes are closed again."""

import numpy as np
import pytest
import trimesh

from exporters.surface.closing import closed, solid_pieces


def in_trimesh(positions: np.ndarray, triangles: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(positions, triangles, process=False)


@pytest.fixture
def sphere() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=2)


def test_a_closed_mesh_stays(sphere):
    positions, triangles = closed(sphere.vertices, sphere.faces)
    np.testing.assert_array_equal(positions, sphere.vertices)
    np.testing.assert_array_equal(triangles, sphere.faces)


@pytest.mark.parametrize("seed", range(5))
def test_holes_are_filled(sphere, seed):
    kept = np.random.default_rng(seed).random(len(sphere.faces)) > 0.2
    found = in_trimesh(*closed(sphere.vertices, sphere.faces[kept]))
    assert found.is_watertight
    assert found.is_winding_consistent
    assert found.volume == pytest.approx(sphere.volume, rel=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_sheets_that_meet_in_an_edge_are_cut(sphere, seed):
    """Merging random pairs of vertices makes edges of three and four faces."""
    pairs = np.random.default_rng(seed).choice(len(sphere.vertices), (10, 2), replace=False)
    merged = np.arange(len(sphere.vertices))
    merged[pairs[:, 0]] = pairs[:, 1]
    faces = merged[sphere.faces]
    neighbors = sphere.edges_unique[seed]
    faces[faces == neighbors[0]] = neighbors[1]
    found = in_trimesh(*closed(sphere.vertices, faces))
    assert found.is_watertight
    assert found.is_winding_consistent


def test_a_face_turned_over_is_replaced(sphere):
    faces = sphere.faces.copy()
    faces[7] = faces[7][::-1]
    found = in_trimesh(*closed(sphere.vertices, faces))
    assert found.is_watertight
    assert found.is_winding_consistent


def test_crumbs_and_unused_vertices_go(sphere):
    crumb = sphere.copy()
    crumb.apply_scale(0.01)
    crumb.apply_translation([3, 0, 0])
    both = trimesh.util.concatenate([crumb, sphere])
    positions = np.concatenate([both.vertices, [[9.0, 9.0, 9.0]]])
    positions, triangles = solid_pieces(positions, both.faces, 0.1)
    np.testing.assert_allclose(positions, sphere.vertices)
    np.testing.assert_array_equal(triangles, sphere.faces)


def test_the_wall_of_a_hollow_goes_even_if_it_touches(sphere):
    wall = sphere.copy()
    wall.apply_scale(0.5)
    wall.invert()
    both = trimesh.util.concatenate([sphere, wall])
    faces = both.faces.copy()
    faces[faces == faces[-1, 0]] = 0  # one vertex of the wall is one of the sphere
    positions, triangles = solid_pieces(both.vertices, faces, 0.1)
    assert len(triangles) == len(sphere.faces)
    assert in_trimesh(positions, triangles).volume == pytest.approx(sphere.volume)
