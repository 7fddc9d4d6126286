"""A closed surface whose colors come from a texture: what Quick Look and RealityKit show."""

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from exporters.atomic import replacing
from exporters.companions import texture_path
from exporters.skinned_mesh import SkinnedMesh
from exporters.vertex_texture import vertex_texture


def bind_texture(
    stage: Usd.Stage, mesh: UsdGeom.Mesh, skinned: SkinnedMesh, material_path: str, target: Path
) -> tuple[Path, ...]:
    """Save the colors of a mesh as a texture, and bind the mesh to a material that shows it.

    The colors glow and nothing is reflected, since a splat's color already contains the light. The
    workflow is the metallic one: RealityKit knows no other.

    Args:
        stage: Receives the material.
        mesh: The prim of `skinned`.
        skinned: The mesh, of triangles.
        material_path: Where the material goes.
        target: The asset that is written: a package takes the texture in, others have it beside.

    Returns:
        The texture, if it lies beside the asset.

    Raises:
        WriteError: If the texture cannot be written.
    """
    texture = vertex_texture(skinned)
    beside = texture_path(target)
    is_package = target.suffix.lower() == ".usdz"
    if is_package:
        staging = Path(stage.GetRootLayer().realPath).parent
        beside = staging / "colors.png"
        _save_png(texture.pixels, beside)
    else:
        with replacing(beside) as staged:
            _save_png(texture.pixels, staged)
    coordinates = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    coordinates.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(texture.uvs.reshape(-1, 2))))
    material = _define_material(stage, material_path, f"./{beside.name}")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    return () if is_package else (beside,)


def _save_png(pixels: np.ndarray, path: Path) -> None:
    from PIL import Image

    Image.fromarray(pixels).save(path, format="PNG")


def _define_material(stage: Usd.Stage, path: str, asset_path: str) -> UsdShade.Material:
    types = Sdf.ValueTypeNames
    material = UsdShade.Material.Define(stage, path)
    reader = UsdShade.Shader.Define(stage, f"{path}/Coordinates")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", types.String).Set("st")
    texture = UsdShade.Shader.Define(stage, f"{path}/Texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", types.Asset).Set(asset_path)
    texture.CreateInput("sourceColorSpace", types.Token).Set("sRGB")
    texture.CreateInput("st", types.Float2).ConnectToSource(
        reader.CreateOutput("result", types.Float2)
    )
    surface = UsdShade.Shader.Define(stage, f"{path}/Surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("emissiveColor", types.Color3f).ConnectToSource(
        texture.CreateOutput("rgb", types.Float3)
    )
    surface.CreateInput("diffuseColor", types.Color3f).Set(Gf.Vec3f(0.0))
    surface.CreateInput("roughness", types.Float).Set(1.0)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", types.Token))
    return material
