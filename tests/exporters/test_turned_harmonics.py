"""Turned color patterns against scipy's own spherical harmonics, and where they end up in files."""

import dataclasses
import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plyfile import PlyData
from scipy.spatial.transform import Rotation
from scipy.special import sph_harm_y

from exporters import harmonics
from exporters.baking import bake_frames
from exporters.options import ExportOptions
from exporters.ply.sequence import write_ply_sequence
from tests.helpers import clips

TURNS = {
    "none": (1, 0, 0, 0),
    "half about x": (0, 1, 0, 0),
    "half about y": (0, 0, 1, 0),
    "half about z": (0, 0, 0, 1),
    "quarter about y": (np.sqrt(0.5), 0, np.sqrt(0.5), 0),
    "almost none": (1, 1e-7, -1e-7, 1e-7),
}


def colors(sh_coeffs: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Sum the real harmonics, with the Condon-Shortley sign, made from scipy's complex ones."""
    x, y, z = direction / np.linalg.norm(direction)
    total = np.zeros(3)
    for degree in range(round(np.sqrt(len(sh_coeffs)))):
        for m in range(-degree, degree + 1):
            value = sph_harm_y(degree, abs(m), np.arccos(np.clip(z, -1, 1)), np.arctan2(y, x))
            part = value.real if m >= 0 else value.imag
            scale = 1 if m == 0 else np.sqrt(2)
            total += scale * part * sh_coeffs[degree * degree + degree + m]
    return total


def check(sh_coeffs: np.ndarray, quats_wxyz: np.ndarray, rng: np.random.Generator) -> None:
    turned = harmonics.rotate_each(sh_coeffs, quats_wxyz)
    assert turned.shape == sh_coeffs.shape
    assert turned.dtype == np.float32
    for before, after, quat_wxyz in zip(sh_coeffs, turned, quats_wxyz, strict=True):
        turn = Rotation.from_quat(quat_wxyz, scalar_first=True)
        for direction in rng.normal(size=(4, 3)):
            expected = colors(before, turn.inv().apply(direction))
            np.testing.assert_allclose(colors(after, direction), expected, atol=2e-5)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@settings(derandomize=True, max_examples=8, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_pattern_turns_with_the_gaussian(degree, seed):
    rng = np.random.default_rng(seed)
    sh_coeffs = rng.normal(size=(3, (degree + 1) ** 2, 3)).astype(np.float32)
    quats_wxyz = rng.normal(size=(3, 4))
    quats_wxyz /= np.linalg.norm(quats_wxyz, axis=1, keepdims=True)
    check(sh_coeffs, quats_wxyz, rng)


@pytest.mark.parametrize("quat_wxyz", TURNS.values(), ids=TURNS.keys())
def test_turns_without_unique_angles(quat_wxyz):
    rng = np.random.default_rng(4)
    check(rng.normal(size=(1, 16, 3)).astype(np.float32), np.array([quat_wxyz], float), rng)


def test_blocks_do_not_matter(monkeypatch):
    rng = np.random.default_rng(5)
    sh_coeffs = rng.normal(size=(50, 16, 3)).astype(np.float32)
    quats_wxyz = Rotation.random(50, rng=rng).as_quat(scalar_first=True)
    expected = harmonics.rotate_each(sh_coeffs, quats_wxyz)
    monkeypatch.setattr(harmonics, "BLOCK_ROWS", 7)
    np.testing.assert_allclose(harmonics.rotate_each(sh_coeffs, quats_wxyz), expected, atol=1e-6)


def test_baked_patterns_follow_the_exact_turn_of_each_gaussian():
    clip = clips.hinge()
    splats = clips.splats(clip.splats.positions, sh_degree=3)
    clip = dataclasses.replace(clip, splats=splats)
    frames = list(bake_frames(clip, rotate_sh=True))
    np.testing.assert_allclose(frames[0].sh_coeffs, splats.sh_coeffs, atol=1e-6)
    direction = np.array([0.3, -0.5, 0.8])
    for index, degrees in enumerate((0, 90, 45)):  # the root, the door, the Gaussian on the hinge
        turn = Rotation.from_rotvec([0, 0, np.radians(degrees)])
        expected = colors(splats.sh_coeffs[index], turn.inv().apply(direction))
        found = colors(frames[-1].sh_coeffs[index], direction)
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_ply_files_hold_the_turned_patterns(tmp_path):
    clip = clips.random(sh_degree=2)
    frames = list(bake_frames(clip, rotate_sh=True))
    written = write_ply_sequence(clip, tmp_path / "clip_gaussians", ExportOptions(rotate_sh=True))
    for path, frame in zip(written, frames, strict=True):
        vertex = PlyData.read(path)["vertex"]
        found = np.stack([vertex[f"f_rest_{i}"] for i in range(24)], axis=1)
        # Channel by channel, 8 coefficients each.
        np.testing.assert_array_equal(
            found.reshape(-1, 3, 8), frame.sh_coeffs[:, 1:].transpose(0, 2, 1)
        )
        np.testing.assert_array_equal(vertex["f_dc_1"], clip.splats.sh_coeffs[:, 0, 1])


@pytest.mark.parametrize(("rotate_sh", "warnings"), [(True, 0), (False, 1)])
def test_the_warning_goes_when_the_patterns_turn(rotate_sh, warnings, caplog):
    with caplog.at_level(logging.WARNING):
        frames = list(bake_frames(clips.random(), rotate_sh=rotate_sh))
    assert len(caplog.records) == warnings
    assert (frames[0].sh_coeffs is None) is not rotate_sh
