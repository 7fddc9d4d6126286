"""The surface mesh of solids whose shape is known."""

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest
import trimesh

from exporters.clip import Skin, Splats
from exporters.errors import ClipError
from exporters.skinned_mesh import SkinnedMesh
from exporters.surface import control_mesh as control_mesh_module
from exporters.surface.control_mesh import LEAST_FACES, control_mesh
from tests.helpers import clips, silhouettes, solids

FACES = 2000


def checked(mesh: SkinnedMesh) -> trimesh.Trimesh:
    """The mesh in trimesh, after what holds for every surface."""
    found = trimesh.Trimesh(mesh.positions, mesh.faces, process=False)
    assert found.is_watertight
    assert found.is_winding_consistent
    assert found.volume > 0
    assert mesh.is_closed
    assert mesh.positions.dtype == mesh.normals.dtype == mesh.colors_linear.dtype == np.float32
    assert mesh.faces.dtype == mesh.joint_ids.dtype == np.int32
    assert len(np.unique(mesh.faces)) == len(mesh.positions)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    assert ((mesh.colors_linear >= 0) & (mesh.colors_linear <= 1)).all()
    assert (mesh.opacities == 1).all()
    np.testing.assert_allclose(mesh.weights.sum(axis=1, dtype=np.float64), 1, atol=1.5e-7)
    for joints, weights in zip(mesh.joint_ids, mesh.weights, strict=True):
        used = joints[weights > 0]
        assert len(set(used)) == len(used)
        assert (joints[weights == 0] == 0).all()
    return found


@pytest.fixture(scope="module", autouse=True)
def coarse_grid() -> Iterator[None]:
    """Half as fine as in earnest: an eighth of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(control_mesh_module, "CELLS_ALONG", 128)
        yield


@pytest.fixture(scope="module")
def ball_mesh(coarse_grid: None) -> SkinnedMesh:
    return control_mesh(solids.clip_of(solids.ball()), FACES)


def drawn_silhouette(splats: Splats, pixels: np.ndarray) -> np.ndarray:
    """Where the Gaussians, seen along z from far away, cover half the background.

    Args:
        splats: Of quaternions without z part, as in `solids.ball`, and with equal first two scales.
        pixels: Coordinates of pixels along x, and along y, shape (M,).
    """
    passed = np.ones((len(pixels), len(pixels)))
    for center, (w, x, y, _), (wide, _, thin) in zip(
        splats.positions, splats.quats_wxyz, splats.scales, strict=True
    ):
        tilt = np.array([2 * w * y, -2 * w * x])  # x and y of the normal
        covariance = wide**2 * np.eye(2) + (thin**2 - wide**2) * np.outer(tilt, tilt)
        ((a, b), (_, c)) = np.linalg.inv(covariance)
        dx, dy = pixels[None, :] - center[0], pixels[:, None] - center[1]
        passed *= 1 - 0.9 * np.exp(-0.5 * (a * dx * dx + 2 * b * dx * dy + c * dy * dy))
    return passed <= 0.5


def test_a_shell_of_disks_becomes_a_solid_ball(ball_mesh: SkinnedMesh) -> None:
    found = checked(ball_mesh)
    assert found.body_count == 1  # no second surface around the hollow inside
    assert found.euler_number == 2
    radii = np.linalg.norm(ball_mesh.positions, axis=1)
    assert 0.99 < radii.min() < radii.max() < 1.05
    outward = np.einsum("vi,vi->v", ball_mesh.normals, ball_mesh.positions) / radii
    assert np.median(outward) > 0.98


def test_a_pinhole_does_not_make_it_hollow(ball_mesh: SkinnedMesh) -> None:
    """The hole is near a fiftieth of the diagonal wide, and rattling about inside is junk."""
    leaky = dataclasses.replace(solids.ball(), opacities=np.where(np.arange(800) == 400, 0, 0.9))
    junk = solids.ball((0.1, 0.2, 0.3), 0.1, count=20)
    found = checked(control_mesh(solids.clip_of(solids.joined(leaky, junk)), FACES))
    assert found.body_count == 1
    assert found.volume == pytest.approx(checked(ball_mesh).volume, rel=0.01)


def test_its_silhouette_is_that_of_the_drawn_gaussians(ball_mesh: SkinnedMesh) -> None:
    cam_from_world = np.eye(4)
    cam_from_world[2, 3] = 1000.0
    found = silhouettes.covered(
        ball_mesh.positions,
        ball_mesh.faces,
        cam_from_world=cam_from_world,
        intrinsics=np.array([[40_000.0, 0, 50], [0, 40_000, 50], [0, 0, 1]]),
        width_px=100,
        height_px=100,
    )
    truth = drawn_silhouette(solids.ball(), (np.arange(100) + 0.5 - 50) / 40)
    assert silhouettes.intersection_over_union(found, truth) > 0.98
    radius = np.sqrt(truth.sum() / 40**2 / np.pi)
    assert checked(ball_mesh).volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.02)


def test_the_budget_is_kept_and_used(ball_mesh: SkinnedMesh) -> None:
    assert 0.98 * FACES <= len(ball_mesh.faces) <= FACES
    tiny = control_mesh(solids.clip_of(solids.ball()), LEAST_FACES)
    checked(tiny)
    assert 0.9 * LEAST_FACES <= len(tiny.faces) <= LEAST_FACES


def test_two_parts_are_kept_and_strays_are_not() -> None:
    parts = solids.joined(solids.ball(), solids.ball((3.0, 0.0, 0.0), 0.3, count=60))
    rng = np.random.default_rng(0)
    near = solids.chosen(solids.ball(radius=1.8), rng.choice(800, 3, replace=False))
    far = solids.chosen(solids.ball(radius=90.0), np.array([0, 400]))
    far = dataclasses.replace(far, scales=far.scales * 0.01)
    mesh = control_mesh(solids.clip_of(solids.joined(parts, near, far)), FACES)
    assert checked(mesh).body_count == 2
    np.testing.assert_allclose(mesh.positions.min(axis=0), [-1, -1, -1], atol=0.06)
    np.testing.assert_allclose(mesh.positions.max(axis=0), [3.3, 1, 1], atol=0.06)


def test_many_faint_layers_and_one_solid_layer_look_alike(ball_mesh: SkinnedMesh) -> None:
    """The level follows the opacity: faint Gaussians many deep cover as well as one solid."""
    ball = solids.ball()
    faint = dataclasses.replace(solids.joined(*[ball] * 5), opacities=np.full(5 * len(ball), 0.35))
    mesh = control_mesh(solids.clip_of(faint), FACES)
    assert checked(mesh).volume == pytest.approx(checked(ball_mesh).volume, rel=0.03)


def test_the_color_is_that_of_the_outermost() -> None:
    inner = solids.ball(radius=0.93)
    inner = dataclasses.replace(inner, sh_coeffs=np.full(inner.sh_coeffs.shape, -1.7))
    splats = solids.joined(solids.ball(), inner)
    mesh = control_mesh(solids.clip_of(splats), FACES)
    srgb = 0.5 + clips.SH_C0 * np.array([0.5, -0.5, 1.0])
    linear = ((srgb + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(np.median(mesh.colors_linear, axis=0), linear, rtol=0.05)


def test_each_part_follows_its_own_joint() -> None:
    splats = solids.joined(solids.ball(), solids.ball((3.0, 0.0, 0.0), 0.5, count=200))
    skin = clips.skin_to([1] * 800 + [2] * 200)
    mesh = control_mesh(solids.clip_of(splats, skin, joints=3), FACES)
    checked(mesh)
    expected = np.where(mesh.positions[:, 0] < 1.7, 1, 2)
    np.testing.assert_array_equal(mesh.joint_ids[:, 0], expected)
    np.testing.assert_array_equal(mesh.weights[:, 0], 1)


def test_many_joints_are_blended_into_four() -> None:
    rng = np.random.default_rng(1)
    ids = np.argsort(rng.random((800, 40)), axis=1)[:, :4]
    skin = Skin(joint_ids=ids, weights=rng.dirichlet(np.ones(4), 800))
    mesh = control_mesh(solids.clip_of(solids.ball(), skin, joints=40), FACES)
    checked(mesh)
    assert (np.count_nonzero(mesh.weights, axis=1) == 4).mean() > 0.9


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_gaussians_become_blobs(count: int) -> None:
    positions = np.zeros((count, 3))
    positions[:, 0] = np.arange(count)
    splats = Splats(
        positions=positions,
        quats_wxyz=np.tile(clips.IDENTITY, (count, 1)),
        scales=np.full((count, 3), 0.1),
        opacities=np.full(count, 0.9),
        sh_coeffs=np.zeros((count, 1, 3)),
    )
    mesh = control_mesh(solids.clip_of(splats), FACES)
    assert checked(mesh).body_count == count
    # A splat of opacity 0.9 covers half the background within sqrt(2 ln 1.8) sigmas.
    radius = 0.1 * np.sqrt(2 * np.log(1.8))
    np.testing.assert_allclose(np.ptp(mesh.positions[:, 1]) / 2, radius, rtol=0.1)


def test_small_parts_far_apart_are_all_kept() -> None:
    """Three Gaussians a few cells wide."""
    splats = dataclasses.replace(clips.static().splats, opacities=[0.8, 0.9, 0.9])
    mesh = control_mesh(solids.clip_of(splats), FACES)
    assert checked(mesh).body_count == 3
    distances = np.linalg.norm(mesh.positions[:, None] - np.eye(3), axis=2)
    assert set(distances.argmin(axis=1)) == {0, 1, 2}
    assert distances.min(axis=1).max() < 3 * 0.03


def test_a_ghost_has_a_surface_too() -> None:
    splats = dataclasses.replace(solids.ball(), opacities=np.full(800, 0.1))
    mesh = control_mesh(solids.clip_of(splats), FACES)
    checked(mesh)
    assert np.linalg.norm(mesh.positions, axis=1).min() > 0.9
    np.testing.assert_allclose(np.ptp(mesh.positions, axis=0), 2, atol=0.2)


def test_scale_and_place_do_not_matter(ball_mesh: SkinnedMesh) -> None:
    ball = solids.ball()
    large = dataclasses.replace(
        ball, positions=ball.positions * 1000 + 5000, scales=ball.scales * 1000
    )
    mesh = control_mesh(solids.clip_of(large), FACES)
    volume = checked(mesh).volume / 1e9
    assert volume == pytest.approx(checked(ball_mesh).volume, rel=0.01)


def test_the_same_bytes_twice(ball_mesh: SkinnedMesh) -> None:
    again = control_mesh(solids.clip_of(solids.ball()), FACES)
    for field in dataclasses.fields(SkinnedMesh):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(ball_mesh, field.name))


def test_refusals() -> None:
    invisible = dataclasses.replace(solids.ball(), opacities=np.full(800, 0.001))
    with pytest.raises(ClipError, match=r"too faint .* quads"):
        control_mesh(solids.clip_of(invisible), FACES)
    with pytest.raises(ClipError, match=f"at least {LEAST_FACES} triangles"):
        control_mesh(solids.clip_of(solids.ball()), LEAST_FACES - 1)
