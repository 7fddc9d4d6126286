"""A clip as time-sampled Gaussians: the exact motion, for tools that draw splats."""

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdVol

from exporters import bounds
from exporters.adaptation import adapt
from exporters.baking import Progress, bake_frames
from exporters.clip import Clip, Splats
from exporters.options import ExportOptions
from exporters.usd import values
from exporters.usd.camera import define_camera
from exporters.usd.stage import define_root, writing_stage


def write_usd_cache(
    clip: Clip,
    path: str | Path,
    options: ExportOptions | None = None,
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Write the Gaussians as one time-sampled ParticleField3DGaussianSplat.

    ```
    /Name            Xform, default prim, kind component
      /Splats        positions, orientations and 3-sigma extent sampled at every whole time code;
                     scales, opacities and spherical harmonics once
      /Camera        Camera, if the clip has one
    ```

    Binary files are saved frame by frame: memory does not grow with the length of the clip.

    Args:
        clip: The clip.
        path: The target, best `.usdc`; `.usda` is text, and many times larger.
        options: Choices; None for the defaults.
        progress: Called with the frames done and their total.

    Returns:
        The one file written.

    Raises:
        ClipError: If the clip is not valid.
        WriteError: If the file cannot be written.
    """
    clip.validate()
    clip = adapt(clip, options or ExportOptions())
    appends = Path(path).suffix.lower() != ".usda"  # a text layer is written anew by each Save
    with writing_stage(clip, path) as stage:
        root = define_root(stage, clip, "Xform")
        root_path = str(root.GetPath())
        define_camera(stage, clip, f"{root_path}/Camera", bounds.swept_extent(clip))
        field = _define_field(stage, clip.splats, f"{root_path}/Splats")
        extents = []
        for frame in bake_frames(clip, progress):
            extent = bounds.ellipsoid_extent(frame.posed, clip.splats.scales)
            field.GetPositionsAttr().Set(values.vectors(frame.posed.positions), frame.code)
            field.GetOrientationsAttr().Set(values.quats(frame.posed.quats_wxyz), frame.code)
            field.GetExtentAttr().Set(values.vectors(extent), frame.code)
            extents.append(extent)
            if appends:
                stage.Save()
        _hint_extent(root, np.concatenate(extents))
    return (Path(path),)


def _define_field(
    stage: Usd.Stage, splats: Splats, path: str
) -> UsdVol.ParticleField3DGaussianSplat:
    """Define the prim with all that does not change.

    Every attribute has exactly one value a Gaussian (K for the harmonics): readers that find
    another count ignore the attribute, or the prim. Scales are linear and opacities 0..1.
    """
    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, path)
    field.CreatePositionsAttr()
    field.CreateOrientationsAttr()
    field.CreateExtentAttr()
    field.CreateScalesAttr(values.vectors(splats.scales))
    field.CreateOpacitiesAttr(values.floats(splats.opacities))
    field.CreateProjectionModeHintAttr(UsdVol.Tokens.perspective)
    field.CreateSortingModeHintAttr(UsdVol.Tokens.zDepth)  # as INRIA's renderer, that trains them
    field.CreateRadianceSphericalHarmonicsDegreeAttr(splats.sh_degree)
    field.CreateRadianceSphericalHarmonicsCoefficientsAttr(
        values.vectors(splats.sh_coeffs.reshape(-1, 3))
    )
    return field


def _hint_extent(root: Usd.Prim, corners: np.ndarray) -> None:
    """Tell viewers the box of the whole motion, so that they need not read it."""
    model = UsdGeom.ModelAPI.Apply(root)
    model.SetExtentsHint(values.vectors(bounds.point_extent(corners)))
