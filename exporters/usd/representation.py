"""Moving splats in a rigged asset, beside its skinned meshes, of which a viewer shows one kind.

A tool that draws splats would draw them on top of the meshes. A variant set `representation` with
the variants `mesh` and `splats` switches the other ones off, so that every tool shows one thing:

* `mesh` is selected in the file: Blender 5.0 and three.js know no splats, and must find the mesh.
  (The purposes `proxy` and `render` would not do: Blender leaves out `proxy` unless asked.)
* Omniverse, Houdini and Blender from 5.3 show the splats once `splats` is selected; Blender and
  other tools that cannot select a variant read them from the file that `payload` writes, or from
  the USD cache.

The prims themselves lie outside the variants: the file holds them, whatever is selected.
"""

from collections.abc import Sequence
from pathlib import Path

from pxr import Sdf, Usd, UsdVol

from exporters.clip import Clip
from exporters.companions import payload_path
from exporters.options import ExportOptions
from exporters.usd.cache import write_usd_cache
from exporters.usd.names import identifier
from exporters.usd.splats import SPLATS_NAME, write_splats

VARIANT_SET = "representation"
DEFAULT_VARIANT = "mesh"


def add_splats(
    stage: Usd.Stage, clip: Clip, mesh_names: Sequence[str], target: Path, options: ExportOptions
) -> tuple[Path, ...]:
    """Add the splats that `usd_splats` asks for to a rig's stage; prims found before may expire.

    Args:
        stage: The rig, its default prim named after the clip.
        clip: The exact motion, adapted to the options, with all its joints.
        mesh_names: Prims below the root that show the same as the splats.
        target: The asset that is written: a package takes the payload in, others have it beside.
        options: `usd_splats`, and what `write_splats` looks at.

    Returns:
        The payload, if it lies beside the asset.

    Raises:
        WriteError: If the payload cannot be written.
    """
    if options.usd_splats == "none":
        return ()
    root_path = Sdf.Path(f"/{identifier(clip.name)}")
    splats_path = root_path.AppendChild(SPLATS_NAME)
    beside: tuple[Path, ...] = ()
    if options.usd_splats == "sibling":
        write_splats(stage, clip, str(splats_path), options)
    else:
        beside = _add_payload(stage, clip, splats_path, target, options)
    if mesh_names:
        meshes = [root_path.AppendChild(name) for name in mesh_names]
        _add_variants(stage.GetPrimAtPath(root_path), {"mesh": [splats_path], "splats": meshes})
    return beside


def _add_payload(
    stage: Usd.Stage, clip: Clip, splats_path: Sdf.Path, target: Path, options: ExportOptions
) -> tuple[Path, ...]:
    """Write the splats as a cache of their own, and let a prim of the rig have it for payload."""
    is_package = target.suffix.lower() == ".usdz"
    staging = Path(stage.GetRootLayer().realPath).parent
    payload = staging / "splats.usdc" if is_package else payload_path(target)
    write_usd_cache(clip, payload, options)
    # The rig is staged elsewhere: from there, the payload beside its target is not to be found.
    stage.SetLoadRules(Usd.StageLoadRules.LoadNone())
    prim = UsdVol.ParticleField3DGaussianSplat.Define(stage, splats_path).GetPrim()
    prim.GetPayloads().AddPayload(f"./{payload.name}", splats_path)
    return () if is_package else (payload,)


def _add_variants(root: Usd.Prim, hidden: dict[str, list[Sdf.Path]]) -> None:
    """Add variants that each switch some prims off."""
    variants = root.GetVariantSets().AddVariantSet(VARIANT_SET)
    for name, paths in hidden.items():
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            for path in paths:
                root.GetStage().OverridePrim(path).SetActive(False)
    variants.SetVariantSelection(DEFAULT_VARIANT)
