"""Ways to break one thing in a USD stage."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, Vt

from exporters import export_clip
from exporters.check import check_file
from tests.helpers import clips

GAUSSIANS, JOINTS = 8, 5
SKEL, ANIM, MESH, SPLATS = "/random/Skel", "/random/Skel/Anim", "/random/Carrier", "/random/Splats"

Edit = Callable[[Usd.Stage], object]


def attribute(
    path: str, name: str, change: Callable[[np.ndarray], object], sample: int = 0
) -> Edit:
    """Change the numbers of an attribute, in one sample if it is animated.

    `change` may work in place, or return other numbers.
    """

    def edit(stage: Usd.Stage) -> None:
        found = stage.GetAttributeAtPath(f"{path}.{name}")
        times = found.GetTimeSamples()
        time = Usd.TimeCode(times[sample]) if times else Usd.TimeCode.Default()
        value = found.Get(time)
        values = np.array(value)
        other = change(values)
        values = values if other is None else other
        found.Set(type(value).FromNumpy(np.ascontiguousarray(values)), time)

    return edit


def put(index: object, value: object) -> Callable[[np.ndarray], None]:
    return lambda values: values.__setitem__(index, value)


def shorter(values: np.ndarray) -> np.ndarray:
    return values[:-1]


def without(path: str, name: str) -> Edit:
    """Take an opinion away, as if it had never been written."""
    return lambda stage: stage.GetPrimAtPath(path).RemoveProperty(name)


def joints(path: str, change: Callable[[list[str]], list[str]]) -> Edit:
    def edit(stage: Usd.Stage) -> None:
        found = stage.GetAttributeAtPath(f"{path}.joints")
        found.Set(Vt.TokenArray(change(list(found.Get()))))

    return edit


def metadata(path: str, name: str, key: str, value: object) -> Edit:
    return lambda stage: stage.GetAttributeAtPath(f"{path}.{name}").SetMetadata(key, value)


def repeat_joint(stage: Usd.Stage) -> None:
    attribute(MESH, "primvars:skel:jointIndices", put(slice(20, 24), [2, 2, 0, 0]))(stage)
    attribute(MESH, "primvars:skel:jointWeights", put(slice(20, 24), [0.5, 0.5, 0, 0]))(stage)


def payload(asset: str) -> Edit:
    def edit(stage: Usd.Stage) -> None:
        stage.DefinePrim("/random/More").GetPayloads().AddPayload(asset)

    return edit


def texture(stage: Usd.Stage) -> None:
    prim = stage.GetPrimAtPath("/random")
    prim.CreateAttribute("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath("gone.png"))


def other_type(stage: Usd.Stage) -> None:
    spec = stage.GetRootLayer().GetAttributeAtPath(f"{MESH}.points")
    owner = spec.owner
    owner.RemoveProperty(spec)
    Sdf.AttributeSpec(owner, "points", Sdf.ValueTypeNames.FloatArray).default = Vt.FloatArray(96)


def late_start(stage: Usd.Stage) -> None:
    for prim in stage.Traverse():
        for found in prim.GetAuthoredAttributes():
            for time in reversed(found.GetTimeSamples()):
                found.Set(found.Get(time), time + 1)
                found.ClearAtTime(time)
    stage.SetEndTimeCode(stage.GetEndTimeCode() + 1)


def good_usda(path: Path) -> Path:
    """Write a file with all that there is to break."""
    export_clip(clips.random(gaussians=GAUSSIANS, joints=JOINTS, keys=4), path)
    return path


def said_of(good: Path, edit: Edit, path: Path) -> list[str]:
    """Copy a good file to `path`, break it and return what the checker says."""
    path.write_bytes(good.read_bytes())
    stage = Usd.Stage.Open(str(path))
    edit(stage)
    stage.Save()
    del stage
    return [str(problem) for problem in check_file(path, is_trusted=True)]
