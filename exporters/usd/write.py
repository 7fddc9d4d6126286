"""A clip as a skinned USD asset."""

from pathlib import Path

from pxr import UsdSkel

from exporters import bounds
from exporters.adaptation import adapt
from exporters.clip import Clip
from exporters.joint_limit import within_limit
from exporters.meshes import meshes_of
from exporters.options import ExportOptions
from exporters.usd import values
from exporters.usd.camera import define_camera
from exporters.usd.material import bind_material
from exporters.usd.representation import add_splats
from exporters.usd.skeleton import define_skeleton
from exporters.usd.skinned_mesh import define_skinned_mesh
from exporters.usd.stage import define_root, writing_stage
from exporters.usd.texture import bind_texture


def write_usd_rig(
    clip: Clip, path: str | Path, options: ExportOptions | None = None
) -> tuple[Path, ...]:
    """Write skeleton, animation, skinned meshes and camera.

    ```
    /Name            SkelRoot, default prim, kind component, extent of the whole motion
      /Skel          Skeleton
        /Anim        SkelAnimation, sampled at the clip's keys
      /Carrier       Mesh, one quad a Gaussian, four influences a point; or as asked for:
      /Surface       Mesh, closed, four influences a point
      /Camera        Camera, if the clip has one
      /Splats        with `usd_splats`: ParticleField3DGaussianSplat, time-sampled, not selected; see
                     `exporters.usd.representation`
      /CarrierMaterial, or /SurfaceMaterial: what shows the mesh's colors
    ```

    Time codes are `times_s * fps` from 0. Axis and unit are the clip's own, named in the stage.

    Args:
        clip: The clip.
        path: The target: `.usdc` or `.usd` binary, `.usda` text, `.usdz` package.
        options: Choices; None for the defaults.

    Returns:
        The file written, and those beside it: a texture, a payload of splats, if asked for.

    Raises:
        ClipError: If the clip is not valid.
        WriteError: If the file cannot be written.
    """
    clip.validate()
    options = options or ExportOptions()
    exact = adapt(clip, options)
    clip = within_limit(exact, options.joint_limit)
    meshes = meshes_of(clip, options)
    beside: tuple[Path, ...] = ()
    with writing_stage(clip, path) as stage:
        root = define_root(stage, clip, "SkelRoot")
        root_path = str(root.GetPath())
        swept_extent = bounds.swept_extent(clip, meshes)
        UsdSkel.Root(root).CreateExtentAttr(values.vectors(swept_extent))
        skeleton = define_skeleton(stage, clip, f"{root_path}/Skel", options)
        for mesh in meshes:
            prim_name = mesh.name.capitalize()
            prim = define_skinned_mesh(stage, mesh, f"{root_path}/{prim_name}", skeleton)
            material_path = f"{root_path}/{prim_name}Material"
            if options.texture and mesh.is_closed:
                beside += bind_texture(stage, prim, mesh, material_path, Path(path))
            else:
                bind_material(stage, prim, mesh, material_path, options.alpha_cutoff)
        define_camera(stage, clip, f"{root_path}/Camera", swept_extent)
        mesh_names = [mesh.name.capitalize() for mesh in meshes]
        beside += add_splats(stage, exact, mesh_names, Path(path), options)
    return (Path(path), *beside)
