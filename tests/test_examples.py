"""The examples run, and do what they say."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from plyfile import PlyData

from exporters import load_clip
from tests.helpers.playback import gltf_centers, usd_centers

EXAMPLES = Path(__file__).parent.parent / "examples"
LAMP = EXAMPLES / "desk_lamp"


def example(name: str) -> ModuleType:
    """Import a script from examples/, whatever its name."""
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def maker(monkeypatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(EXAMPLES))  # as `python examples/make_desk_lamp.py` does
    module = example("make_desk_lamp")
    yield module
    for name in [name for name in sys.modules if name.partition(".")[0] == "toybox"]:
        del sys.modules[name]


def test_the_door_swings_in_every_format(tmp_path):
    written = example("02_export").main(tmp_path)
    assert all(path.is_file() for path in written)
    # Turned by 90 degrees about +y, x becomes -z; the first Gaussian is on the fixed frame.
    expected = np.zeros((12, 3))
    expected[:, 2] = -0.1 * np.arange(12)
    for centers in (
        usd_centers(tmp_path / "door.usda", 1.0),
        gltf_centers(tmp_path / "door.glb", 1.0),
        usd_centers(tmp_path / "door_unreal.usdc", 1.0),
    ):
        np.testing.assert_allclose(centers, expected, atol=1e-6)


def test_inspecting_tells_the_joint_that_moves(tmp_path, capsys):
    door = example("02_export")
    door.main(tmp_path)
    clip = example("03_inspect_clip").main(tmp_path / "door.splatimate.npz")
    assert len(clip.splats) == door.GAUSSIAN_COUNT
    # Half of a quarter turn moves the Gaussian at distance r by 2 r sin(22.5 degrees).
    mean_shift = 2 * np.sin(np.pi / 8) * np.mean(0.1 * np.arange(12))
    assert f"are {mean_shift:.4g} units from rest" in capsys.readouterr().out


@pytest.mark.slow
def test_animating_from_python(tmp_path):
    clip = example("01_animate").main(LAMP / "frames", tmp_path, [0, 2])
    assert clip.source_frames == (0, 2)
    saved = load_clip(tmp_path / "lamp.splatimate.npz")
    np.testing.assert_array_equal(saved.tracks.quats_wxyz, clip.tracks.quats_wxyz)


def test_the_lamp_keeps_together(maker):
    """Where a part hinges on the next one, both agree in every frame."""
    transforms = maker.true_transforms()
    hinges = [(0, 1, 0.0), (1, 2, 0.30), (2, 3, 0.62), (3, 4, 0.46)]
    for parent, child, height in hinges:
        on_parent = transforms[:, parent] @ [0.0, height, 0.0, 1.0]
        on_child = transforms[:, child] @ [0.0, 0.0, 0.0, 1.0]
        np.testing.assert_allclose(on_parent, on_child, atol=1e-12)


def test_the_joints_bend_by_the_stated_angles(maker):
    first, last = maker.true_transforms()[[0, -1]]
    for parent, child, expected_deg in ((0, 1, 38.0), (1, 2, 48.0), (2, 3, 52.0), (3, 4, 20.0)):
        before = np.linalg.inv(first[parent]) @ first[child]
        after = np.linalg.inv(last[parent]) @ last[child]
        cosine = (np.trace((after @ np.linalg.inv(before))[:3, :3]) - 1) / 2
        assert np.degrees(np.arccos(cosine)) == pytest.approx(expected_deg, abs=1e-6)


def test_gaussians_lie_on_the_surfaces_they_cover(maker):
    from toybox.splats import cover
    from toybox.surfaces import Ball, Patch, Tube

    def paint(surface_xy):
        return np.tile([0.2, 0.5, 0.8], (len(surface_xy), 1))

    ball = Ball(center=np.array([1.0, 2.0, 3.0]), radius=0.5)
    cone = Tube(bottom_radius=0.3, top_radius=0.1, bottom_y=0.0, top_y=0.4)
    patches = [[Patch(shape=ball, pattern=paint)], [Patch(shape=cone, pattern=paint)]]
    splats = cover(patches, 600, np.random.default_rng(3))
    on_ball = splats.part_ids == 0
    # The surface between neighbors sags below a cell's points by a few percent of the radius.
    distances = np.linalg.norm(splats.positions[on_ball] - ball.center, axis=1)
    np.testing.assert_allclose(distances, 0.5, atol=0.02)
    shares = np.bincount(splats.part_ids) / len(splats)
    areas = np.array([np.pi, np.pi * 0.4 * np.hypot(0.2, 0.4)])  # 4 pi r^2; pi (r + R) slant
    np.testing.assert_allclose(shares, areas / areas.sum(), atol=0.02)
    heights = splats.positions[~on_ball, 1]
    radii = np.hypot(splats.positions[~on_ball, 0], splats.positions[~on_ball, 2])
    np.testing.assert_allclose(radii, 0.3 - 0.5 * heights, atol=0.02)
    np.testing.assert_allclose(splats.albedos, np.tile([0.2, 0.5, 0.8], (len(splats), 1)))


def test_the_committed_lamp_is_the_one_the_script_makes(maker):
    """The positions can differ in the last digits from machine to machine, not more."""
    rest = maker.lamp_splats(maker.GAUSSIAN_COUNT, seed=0).posed(maker.true_transforms()[0])
    vertices = PlyData.read(LAMP / "lamp.ply")["vertex"]
    committed = np.stack([vertices[axis] for axis in "xyz"], axis=1)
    assert len(committed) == len(rest)
    distances = np.linalg.norm(committed - rest.positions, axis=1)
    assert np.median(distances) < 1e-6
    with np.load(LAMP / "true_motion.npz") as file:
        np.testing.assert_array_equal(file["part_ids"], rest.part_ids)


def test_the_example_is_small():
    total_bytes = sum(path.stat().st_size for path in LAMP.rglob("*") if path.is_file())
    assert total_bytes < 3_000_000
