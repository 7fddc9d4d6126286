"""The materials that show a mesh's colors: without one most tools draw the mesh gray."""

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from exporters.skinned_mesh import SkinnedMesh

_NO_PRIMVAR = "noReflection"
"""Name of a primvar that no mesh has: its reader gives black, the fallback."""


def bind_material(
    stage: Usd.Stage, mesh: UsdGeom.Mesh, skinned: SkinnedMesh, path: str, alpha_cutoff: float
) -> UsdShade.Material:
    """Define a UsdPreviewSurface at `path` that shows the display colors, and bind the mesh to it.

    The colors glow and nothing is reflected, since a splat's color already contains the light; to
    light the asset anew, connect the color to `diffuseColor` instead. What reflects nothing is read
    from a primvar that does not exist: the plain value beside that connection, the mean color, is
    what tools show that follow no such connection (three.js, the solid view of Blender).

    Opacities are connected only where some face is faint enough to be left out: Blender's EEVEE
    draws whatever has them unsorted, until its render method is set to Dithered.

    Args:
        stage: Receives the material.
        mesh: The prim of `skinned`, with displayColor and, unless closed, displayOpacity.
        skinned: The mesh; a closed one is opaque.
        path: Where the material goes; directly below the root, for Blender makes an empty of what
            lies between, and validators ask for its type.
        alpha_cutoff: Opacity below which a tool that does not blend leaves a face out, 0..1.
    """
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/Surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    types = Sdf.ValueTypeNames
    color = _define_reader(stage, f"{path}/Color", "displayColor", Gf.Vec3f(0.5))
    black = _define_reader(stage, f"{path}/Black", _NO_PRIMVAR, Gf.Vec3f(0.0))
    surface.CreateInput("emissiveColor", types.Color3f).ConnectToSource(color)
    diffuse = surface.CreateInput("diffuseColor", types.Color3f)
    mean = skinned.colors_linear.mean(axis=0, dtype=np.float64)
    diffuse.Set(Gf.Vec3f(*map(float, mean)))
    diffuse.ConnectToSource(black)
    surface.CreateInput("useSpecularWorkflow", types.Int).Set(1)
    surface.CreateInput("specularColor", types.Color3f).Set(Gf.Vec3f(0.0))
    surface.CreateInput("roughness", types.Float).Set(1.0)
    is_masked = not skinned.is_closed and bool(np.any(skinned.opacities < alpha_cutoff))
    if is_masked:
        opacity = _define_reader(stage, f"{path}/Opacity", "displayOpacity", 1.0)
        surface.CreateInput("opacity", types.Float).ConnectToSource(opacity)
        surface.CreateInput("opacityThreshold", types.Float).Set(alpha_cutoff)
    output = surface.CreateOutput("surface", types.Token)
    material.CreateSurfaceOutput().ConnectToSource(output)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    return material


def _define_reader(
    stage: Usd.Stage, path: str, primvar: str, fallback: Gf.Vec3f | float
) -> UsdShade.Output:
    """Define a node that reads a primvar, and return its output."""
    is_float = isinstance(fallback, float)
    reader = UsdShade.Shader.Define(stage, path)
    reader.CreateIdAttr("UsdPrimvarReader_float" if is_float else "UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(primvar)
    value_type = Sdf.ValueTypeNames.Float if is_float else Sdf.ValueTypeNames.Float3
    reader.CreateInput("fallback", value_type).Set(fallback)
    return reader.CreateOutput("result", value_type)
