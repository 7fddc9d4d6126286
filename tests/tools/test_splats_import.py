"""What tools that know no splats make of those in a .glb: points, which at least move with their parts."""

from pathlib import Path

import numpy as np
import pytest

from exporters.clip import Clip
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.tools.expected import moments
from tests.tools.playing import play_in_blender, play_in_three

pytestmark = pytest.mark.tools


def test_pieces_of_splats_move_alike_in_blender_and_three(
    fitted_lamp: Clip, tmp_path: Path
) -> None:
    path = tmp_path / "lamp.glb"
    export_clip(fitted_lamp, path, ExportOptions(splats="parts"))
    keys_s, _ = moments(fitted_lamp)
    blender = play_in_blender(path, keys_s, fps=fitted_lamp.fps)
    three = play_in_three(path, keys_s)
    assert blender.scene["switched_off"] == ["splat_parts"]
    assert set(blender.points) == set(three.points)
    assert sum(piece.rest.shape[0] for piece in three.points.values()) == len(fitted_lamp.splats)
    moved = 0.0
    for name, piece in three.points.items():
        np.testing.assert_allclose(blender.points[name].posed, piece.posed, atol=1e-5)
        moved = max(moved, float(np.abs(piece.posed[-1] - piece.rest).max()))
    assert moved > 0.1


@pytest.mark.parametrize("place", ["sibling", "payload"])
def test_splats_beside_a_usd_mesh_disturb_nobody(
    place: str, fitted_lamp: Clip, tmp_path: Path
) -> None:
    path = tmp_path / "lamp.usdc"
    export_clip(fitted_lamp, path, ExportOptions(usd_splats=place))
    for played in (
        play_in_blender(path, [0.0], fps=fitted_lamp.fps),
        play_in_three(path, [0.0]),
    ):
        assert set(played.meshes) == {"carrier"}
        assert not played.points
