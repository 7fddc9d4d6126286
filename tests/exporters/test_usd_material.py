"""The material of a USD mesh shows the splats' colors, in tools that follow it and those that do not."""

import dataclasses

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade

from exporters.clip import Clip
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.helpers import clips
from tests.helpers.validators import usd_errors


def surface_of(stage: Usd.Stage, mesh_path: str) -> UsdShade.Shader:
    binding = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(mesh_path))
    material, _ = binding.ComputeBoundMaterial()
    return material.ComputeSurfaceSource()[0]


def read_primvar(shader: UsdShade.Shader, name: str) -> tuple[str, object]:
    """Return the primvar that an input is connected to, and what it is without the primvar."""
    source = shader.GetInput(name).GetConnectedSources()[0][0].source
    reader = UsdShade.Shader(source.GetPrim())
    assert reader.GetShaderId().startswith("UsdPrimvarReader_float")
    return reader.GetInput("varname").Get(), reader.GetInput("fallback").Get()


def faint(clip: Clip) -> Clip:
    opacities = np.array([0.05, 0.5, 0.9])
    return dataclasses.replace(clip, splats=dataclasses.replace(clip.splats, opacities=opacities))


def test_colors_glow_and_nothing_is_reflected(tmp_path):
    export_clip(clips.hinge(), tmp_path / "hinge.usda")
    stage = Usd.Stage.Open(str(tmp_path / "hinge.usda"))
    surface = surface_of(stage, "/hinge/Carrier")
    assert surface.GetShaderId() == "UsdPreviewSurface"
    assert read_primvar(surface, "emissiveColor")[0] == "displayColor"
    unread, black = read_primvar(surface, "diffuseColor")
    assert not stage.GetPrimAtPath("/hinge/Carrier").HasAttribute(f"primvars:{unread}")
    assert tuple(black) == (0, 0, 0)
    assert usd_errors(tmp_path / "hinge.usda") == []


def test_tools_that_follow_no_connection_find_the_mean_color(tmp_path):
    export_clip(clips.hinge(), tmp_path / "hinge.usda")
    stage = Usd.Stage.Open(str(tmp_path / "hinge.usda"))
    plain = surface_of(stage, "/hinge/Carrier").GetInput("diffuseColor").GetAttr().Get()
    colors = np.array(
        UsdGeom.Gprim(stage.GetPrimAtPath("/hinge/Carrier")).GetDisplayColorAttr().Get()
    )
    np.testing.assert_allclose(plain, colors.mean(axis=0), rtol=1e-6)


@pytest.mark.parametrize("alpha_cutoff", [0.2, 0.04])
def test_only_faces_that_may_vanish_have_opacities(tmp_path, alpha_cutoff):
    path = tmp_path / "faint.usdc"
    export_clip(faint(clips.hinge()), path, ExportOptions(alpha_cutoff=alpha_cutoff))
    stage = Usd.Stage.Open(str(path))
    surface = surface_of(stage, "/hinge/Carrier")
    if alpha_cutoff == 0.2:
        assert read_primvar(surface, "opacity")[0] == "displayOpacity"
        assert surface.GetInput("opacityThreshold").Get() == pytest.approx(alpha_cutoff)
    else:
        assert not surface.GetInput("opacity")
    assert usd_errors(path) == []
