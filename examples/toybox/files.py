"""Write the example in the formats that the command reads."""

import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from animator.types import Gaussians
from toybox.pictures import Shot

_COLUMNS = (
    *("x", "y", "z", "nx", "ny", "nz"),
    *(f"f_dc_{channel}" for channel in range(3)),
    "opacity",
    *(f"scale_{axis}" for axis in range(3)),
    *(f"rot_{component}" for component in range(4)),
)


def write_ply(gaussians: Gaussians, path: Path) -> None:
    """Write Gaussians of SH degree 0 in the INRIA layout: log scales, logit opacities, wxyz."""
    means = gaussians.means.numpy()
    rows = np.concatenate(
        [
            means,
            np.zeros_like(means),
            gaussians.sh_coeffs[:, 0].numpy(),
            gaussians.opacities.logit().numpy()[:, None],
            gaussians.scales.log().numpy(),
            gaussians.quats_wxyz.numpy(),
        ],
        axis=1,
    )
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(rows)}",
        *(f"property float {name}" for name in _COLUMNS),
        "end_header",
    ]
    text = "".join(f"{line}\n" for line in header)
    path.write_bytes(text.encode("ascii") + rows.astype("<f4").tobytes())


def write_png(rgba: np.ndarray, path: Path) -> None:
    """Write a picture, shape (H, W, 4), as small as PNG allows."""
    bgra = np.ascontiguousarray(rgba[:, :, [2, 1, 0, 3]])
    if not cv2.imwrite(str(path), bgra, [cv2.IMWRITE_PNG_COMPRESSION, 9]):
        raise OSError(f"{path}: could not be written")


def write_transforms(shots: Sequence[tuple[str, Shot]], path: Path) -> None:
    """Write cameras as nerfstudio does: camera-to-world, OpenGL axes; one line a camera.

    Args:
        shots: File name and camera of each picture; all of one lens.
        path: The target.
    """
    lens = shots[0][1]
    shared = {
        "camera_model": "OPENCV",
        "fl_x": lens.focal_px,
        "fl_y": lens.focal_px,
        "cx": lens.size_px / 2,
        "cy": lens.size_px / 2,
        "w": lens.size_px,
        "h": lens.size_px,
    }
    frames = [
        {"file_path": name, "transform_matrix": np.round(shot.world_from_opengl, 12).tolist()}
        for name, shot in shots
    ]
    head = ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in shared.items())
    rows = ",\n".join(f"    {json.dumps(frame)}" for frame in frames)
    path.write_text(f'{{\n{head},\n  "frames": [\n{rows}\n  ]\n}}\n', encoding="utf-8")
