"""A clip as time-sampled Gaussians: the exact motion, for tools that draw splats."""

from pathlib import Path

from pxr import UsdGeom

from exporters import bounds
from exporters.adaptation import adapt
from exporters.baking import Progress
from exporters.clip import Clip
from exporters.options import ExportOptions
from exporters.usd import values
from exporters.usd.camera import define_camera
from exporters.usd.splats import SPLATS_NAME, write_splats
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
                     scales and opacities once; spherical harmonics once, or with `rotate_sh` sampled
      /Camera        Camera, if the clip has one
    ```

    Binary files are written frame by frame: memory does not grow with the length of the clip.

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
    options = options or ExportOptions()
    clip = adapt(clip, options)
    with writing_stage(clip, path) as stage:
        root_path = str(define_root(stage, clip, "Xform").GetPath())
        if clip.camera is not None:
            define_camera(stage, clip, f"{root_path}/Camera", bounds.swept_extent(clip))
        extent = write_splats(stage, clip, f"{root_path}/{SPLATS_NAME}", options, progress)
        # Viewers need not read the whole motion to frame it.
        root = UsdGeom.ModelAPI.Apply(stage.GetPrimAtPath(root_path))
        root.SetExtentsHint(values.vectors(extent))
    return (Path(path),)
