"""Rules for a stage as a whole: its metadata, and the files it is composed of."""

import re
from collections.abc import Iterator

from pxr import Sdf, Usd, UsdGeom

from exporters.check.problem import Problem

_ABSOLUTE = re.compile(r"/|\\|[A-Za-z][A-Za-z0-9+.-]*:")


def metadata_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Axis, unit, time base and root are stated: tools assume different ones where they are not.

    UsdGeom, "Encoding Stage UpAxis" and "Linear Units"; UsdStage, "Stage Metadata".
    """
    root = stage.GetPseudoRoot()
    for name in (UsdGeom.Tokens.upAxis, UsdGeom.Tokens.metersPerUnit):
        if not stage.HasAuthoredMetadata(name):
            yield Problem(place="stage", expected=str(name), found="nothing")
    if not UsdGeom.GetStageMetersPerUnit(stage) > 0:
        found = f"{UsdGeom.GetStageMetersPerUnit(stage):g}"
        yield Problem(place="stage", expected="metersPerUnit > 0", found=found)
    is_animated = any(
        attribute.GetNumTimeSamples()
        for prim in stage.Traverse()
        for attribute in prim.GetAuthoredAttributes()
    )
    rate = stage.GetTimeCodesPerSecond()
    if is_animated and not (root.HasAuthoredMetadata("timeCodesPerSecond") and rate > 0):
        yield Problem(place="stage", expected="timeCodesPerSecond > 0", found=f"{rate:g} or none")
    default = stage.GetDefaultPrim()
    if not default:
        found = "none" if not stage.HasDefaultPrim() else "one that is not there"
        yield Problem(place="stage", expected="a defaultPrim", found=found)


def path_problems(layer: Sdf.Layer) -> Iterator[Problem]:
    """Layers name others by relative paths below their own folder, so that it can be moved.

    Files reached from there are looked into too, before anything is composed.
    """
    waiting, seen = [layer], {layer.identifier}
    while waiting:
        current = waiting.pop()
        for path in current.GetCompositionAssetDependencies():
            parts = path.replace("\\", "/").split("/")
            if _ABSOLUTE.match(path) or ".." in parts:
                yield Problem(
                    place=current.GetDisplayName(),
                    expected="paths of files in its folder",
                    found=repr(path[:80]),
                )
                continue
            identifier = current.ComputeAbsolutePath(path)
            if identifier not in seen:
                seen.add(identifier)
                found = Sdf.Layer.FindOrOpen(identifier)
                if found:  # else composing the stage will say so
                    waiting.append(found)


def composition_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Every layer, reference and payload is found (UsdStage::GetCompositionErrors)."""
    for error in stage.GetCompositionErrors():
        found = " ".join(str(error).split())[:200]
        yield Problem(place="stage", expected="layers that can be composed", found=found)
