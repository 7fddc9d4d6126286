"""Draw the README's pictures of other tools: the viewer page in Chromium, Blender's render of the USD.

Needs what `pytest -m tools` needs.

Usage:
    python -m docs.make_screenshots out/clip.splatimate.npz docs
"""

import argparse
import json
import tempfile
from pathlib import Path

import cv2
import numpy as np

from exporters import load_clip
from exporters.clip import Clip
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.tools.browser import screenshot
from tests.tools.playing import run_blender

SHARES = (0.0, 0.5, 1.0)
"""Moments that Blender draws, of the clip's length."""


def main(clip_path: Path, folder: Path) -> None:
    """Draw `viewer.png` and `blender.png` into a folder."""
    clip = load_clip(clip_path)
    with tempfile.TemporaryDirectory() as work:
        draw_viewer(clip, Path(work), folder / "viewer.png")
        draw_in_blender(clip, Path(work), folder / "blender.png")


def draw_viewer(clip: Clip, work: Path, picture_path: Path) -> None:
    """Draw the page with the moving splats of a .glb, half-way through the clip."""
    path = work / f"{clip.name}.glb"
    export_clip(clip, path, ExportOptions(splats="parts"))
    screenshot(
        path,
        picture_path,
        width_px=960,
        height_px=540,
        bare=False,
        time=float(clip.tracks.times_s[-1]) / 2,
        scene="splat_parts",
    )
    save(cv2.imread(str(picture_path)), picture_path)


def draw_in_blender(clip: Clip, work: Path, picture_path: Path) -> None:
    """Draw the surface of a .usdc at three moments, with Cycles and nothing but what is imported."""
    path = work / f"{clip.name}.usdc"
    export_clip(clip, path, ExportOptions(mesh="surface", faces=60_000))
    columns = []
    for share in SHARES:
        frame = round(share * float(clip.tracks.times_s[-1]) * clip.fps)
        settings = {"frame": frame, "width_px": 320, "height_px": 320, "samples": 32}
        out = work / f"{frame}.png"
        run_blender("blender_render.py", path, out, json.dumps({**settings, "turn_deg": 35.0}))
        columns.append(cv2.imread(str(out)))
    save(np.hstack(columns), picture_path)


def save(picture: np.ndarray, path: Path) -> None:
    """Save a picture as a small PNG."""
    cv2.imwrite(str(path), picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clip", metavar="CLIP", type=Path)
    parser.add_argument("folder", metavar="FOLDER", type=Path)
    arguments = parser.parse_args()
    main(arguments.clip, arguments.folder)
