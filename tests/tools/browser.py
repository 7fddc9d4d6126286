"""Pictures of the viewer page of `examples/viewer` in headless Chromium."""

import json
from pathlib import Path
from urllib.parse import quote, urlencode

import cv2
import numpy as np

from tests.helpers.node import run_script

VIEWER = Path(__file__).parents[2] / "examples" / "viewer"
_SITE = "http://localhost:8000"


def screenshot(
    path: Path, out: Path, *, width_px: int, height_px: int, bare: bool = True, **query: object
) -> np.ndarray:
    """Show a .glb on the page and save what is seen.

    Args:
        path: The file to show.
        out: Where the PNG goes.
        width_px: Width of the window.
        height_px: Height of the window.
        bare: Leave out the page's buttons.
        **query: More of the page's parameters: `time`, `view`, `scene`.

    Returns:
        The picture, RGB 0..1, shape (H, W, 3).
    """
    parameters = urlencode({"file": f"/clip/{quote(path.name)}", **query})
    job = {
        "url": f"{_SITE}/examples/viewer/?{parameters}",
        "folders": {f"{_SITE}/examples/viewer/": str(VIEWER), f"{_SITE}/clip/": str(path.parent)},
        "width_px": width_px,
        "height_px": height_px,
        "out": str(out),
        "hide": "#bar" if bare else "",
    }
    run_script("screenshot.mjs", stdin=json.dumps(job))
    return cv2.imread(str(out))[:, :, ::-1] / 255.0
