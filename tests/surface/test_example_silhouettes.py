"""The surface of the committed example against its drawn Gaussians: `pytest -m slow` on this file.

The log, shown with `--log-cli-level INFO`, has the agreement in each view.
"""

import logging
from pathlib import Path

import numpy as np
import pytest
import torch

from animator.render.registry import load_renderer
from animator.scene.cameras import read_cameras
from animator.scene.ply import read_ply
from exporters.clip import Splats
from exporters.surface.control_mesh import control_mesh
from tests.helpers import silhouettes, solids

EXAMPLE = Path(__file__).parents[2] / "examples" / "desk_lamp"


@pytest.mark.slow
def test_the_lamp_and_its_surface_have_one_silhouette() -> None:
    gaussians = read_ply(EXAMPLE / "lamp.ply")
    splats = Splats(
        positions=gaussians.means.numpy(),
        quats_wxyz=gaussians.quats_wxyz.numpy(),
        scales=gaussians.scales.numpy(),
        opacities=gaussians.opacities.numpy(),
        sh_coeffs=gaussians.sh_coeffs.numpy(),
    )
    mesh = control_mesh(solids.clip_of(splats), 20_000)
    renderer = load_renderer("cpu")
    agreements = []
    for camera in read_cameras(EXAMPLE / "transforms_train.json")[::3]:
        with torch.no_grad():
            drawn = renderer.render(gaussians, camera).alpha.numpy() > 0.5
        covered = silhouettes.covered(
            mesh.positions.astype(np.float64),
            mesh.faces,
            cam_from_world=camera.cam_from_world,
            intrinsics=camera.intrinsics,
            width_px=camera.width_px,
            height_px=camera.height_px,
        )
        agreements.append(silhouettes.intersection_over_union(covered, drawn))
    logging.info("%d triangles, IoU %s", len(mesh.faces), np.round(agreements, 4))
    assert np.mean(agreements) >= 0.98
    assert np.min(agreements) >= 0.97
