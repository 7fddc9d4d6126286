"""Opening a USD stage for a clip, and getting it to disk whole."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from pxr import Kind, Tf, Usd, UsdGeom, Vt

from exporters import keyframes
from exporters.atomic import replacing
from exporters.clip import Clip
from exporters.errors import WriteError
from exporters.usd.names import identifier
from exporters.usd.package import pack

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


@contextlib.contextmanager
def writing_stage(clip: Clip, path: str | Path) -> Iterator[Usd.Stage]:
    """Yield a stage with units, axis and time set; save it to `path` when the block ends well.

    Args:
        clip: What the stage is for.
        path: The target; its suffix chooses text, binary or package.

    Raises:
        WriteError: If the suffix is unknown or the place cannot be written.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise WriteError(f"{target}: expected a name ending in one of {', '.join(SUFFIXES)}")
    with replacing(target) as staged:
        is_package = suffix == ".usdz"
        layer_path = staged.with_name(f"{identifier(clip.name)}.usdc") if is_package else staged
        try:
            stage = Usd.Stage.CreateNew(str(layer_path))
            _set_metadata(stage, clip)
            yield stage
            stage.Save()
            if is_package:
                pack(layer_path, staged)
        except Tf.ErrorException as error:
            raise WriteError(f"{target}: USD could not write it ({error})") from error


def define_root(stage: Usd.Stage, clip: Clip, type_name: str) -> Usd.Prim:
    """Define the root prim of the asset, named after the clip, as the stage's default prim."""
    name = identifier(clip.name)
    root = stage.DefinePrim(f"/{name}", type_name)
    stage.SetDefaultPrim(root)
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    if name != clip.name:
        root.SetDisplayName(clip.name)
    if clip.source_frames:
        root.SetCustomDataByKey("splatimate:sourceFrames", Vt.IntArray(clip.source_frames))
    return root


def _set_metadata(stage: Usd.Stage, clip: Clip) -> None:
    is_y_up = clip.up_axis == "Y"
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y if is_y_up else UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, float(clip.meters_per_unit))
    stage.SetFramesPerSecond(float(clip.fps))
    stage.SetTimeCodesPerSecond(float(clip.fps))
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(float(keyframes.key_codes(clip)[-1]))
