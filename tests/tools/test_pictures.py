"""What the viewer page and Blender draw looks like our own render, from the same camera."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from exporters.clip import Clip
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.tools.browser import screenshot
from tests.tools.pictures import own_picture, psnr, read_picture, silhouette_iou
from tests.tools.playing import run_blender

pytestmark = pytest.mark.tools


@pytest.fixture(scope="module")
def lamp(fitted_lamp: Clip) -> Clip:
    """The lamp whose keys fall on whole frames of Blender's: one a frame."""
    codes = np.arange(len(fitted_lamp.tracks), dtype=np.float64)
    tracks = dataclasses.replace(fitted_lamp.tracks, times_s=codes / fitted_lamp.fps)
    return dataclasses.replace(fitted_lamp, tracks=tracks)


def shown(lamp: Clip, options: ExportOptions, folder: Path, **query: object) -> np.ndarray:
    """Draw a .glb of the lamp on the viewer page, as it was filmed."""
    path = folder / "lamp.glb"
    export_clip(lamp, path, options)
    filmed = lamp.camera
    return screenshot(
        path,
        folder / "lamp.png",
        width_px=filmed.width_px,
        height_px=filmed.height_px,
        view="filmed",
        **query,
    )


@pytest.mark.parametrize(("mesh", "least_db"), [("quads", 20.0), ("surface", 24.0)])
def test_the_page_shows_the_mesh_at_its_time(
    mesh: str, least_db: float, lamp: Clip, tmp_path: Path
) -> None:
    times_s = lamp.tracks.times_s
    picture = shown(lamp, ExportOptions(mesh=mesh), tmp_path, time=times_s[1])
    ours = [own_picture(lamp, float(time_s)) for time_s in times_s]
    likeness = [psnr(picture, rgb) for rgb, _ in ours]
    assert np.argmax(likeness) == 1
    assert likeness[1] > least_db
    assert silhouette_iou(picture, ours[1][1]) > 0.9


def test_the_page_shows_the_exact_splats_at_rest(lamp: Clip, tmp_path: Path) -> None:
    picture = shown(lamp, ExportOptions(), tmp_path, scene="rest_splats")
    rgb, coverage = own_picture(lamp, None)
    assert psnr(picture, rgb) > 30.0
    assert silhouette_iou(picture, coverage) > 0.95


def test_the_page_moves_the_splats_of_the_parts(lamp: Clip, tmp_path: Path) -> None:
    time_s = float(lamp.tracks.times_s[1])
    options = ExportOptions(splats="parts")
    picture = shown(lamp, options, tmp_path, scene="splat_parts", time=time_s)
    rgb, coverage = own_picture(lamp, time_s)
    assert psnr(picture, rgb) > 27.0
    assert silhouette_iou(picture, coverage) > 0.93


@pytest.mark.parametrize("suffix", [".usdc", ".glb"])
def test_blender_draws_the_colors_without_a_click(suffix: str, lamp: Clip, tmp_path: Path) -> None:
    path, out = tmp_path / f"lamp{suffix}", tmp_path / "lamp.png"
    export_clip(lamp, path)
    settings = {
        "frame": 1,
        "width_px": lamp.camera.width_px,
        "height_px": lamp.camera.height_px,
        "samples": 8,
    }
    run_blender("blender_render.py", path, out, json.dumps(settings))
    picture = read_picture(out)
    rgb, coverage = own_picture(lamp, float(lamp.tracks.times_s[1]))
    assert psnr(picture, rgb) > 20.0
    assert silhouette_iou(picture, coverage) > 0.9
