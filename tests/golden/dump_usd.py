"""A USD file in plain data: every authored opinion, and the skin played by UsdSkel."""

from pathlib import Path

import numpy as np

from tests.golden.semantics import fix_signs, is_sign_continuous, plain
from tests.helpers.playback import usd_skinned_points


def dump(path: Path, moments_s: list[float] | None = None) -> dict:
    """Describe a stage.

    Args:
        path: A file that USD can open.
        moments_s: Times [s] at which to play its only skinned mesh; None if it has none.
    """
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    described = {
        "default_prim": stage.GetDefaultPrim().GetName(),
        "up_axis": str(UsdGeom.GetStageUpAxis(stage)),
        "meters_per_unit": UsdGeom.GetStageMetersPerUnit(stage),
        "time_codes_per_second": stage.GetTimeCodesPerSecond(),
        "frames_per_second": stage.GetFramesPerSecond(),
        "start_time_code": stage.GetStartTimeCode(),
        "end_time_code": stage.GetEndTimeCode(),
        "prims": {str(prim.GetPath()): _prim(prim) for prim in stage.TraverseAll()},
    }
    if moments_s is not None:
        described["played_carrier"] = [
            {
                "time_s": time_s,
                "positions": usd_skinned_points(stage, time_s * stage.GetTimeCodesPerSecond()),
            }
            for time_s in moments_s
        ]
    return plain(described)


def _prim(prim: object) -> dict:
    metadata = {"kind": prim.GetMetadata("kind"), "displayName": prim.GetMetadata("displayName")}
    return {
        "type_name": str(prim.GetTypeName()),
        "api_schemas": [str(schema) for schema in prim.GetAppliedSchemas()],
        "metadata": {key: value for key, value in metadata.items() if value},
        "attributes": {
            attribute.GetName(): _attribute(attribute) for attribute in prim.GetAuthoredAttributes()
        },
        "relationships": {
            relationship.GetName(): [str(target) for target in relationship.GetTargets()]
            for relationship in prim.GetAuthoredRelationships()
        },
    }


def _attribute(attribute: object) -> dict:
    described = {
        "type": str(attribute.GetTypeName()),
        "variability": attribute.GetVariability().displayName,
    }
    for key in ("interpolation", "elementSize"):
        if attribute.HasAuthoredMetadata(key):
            described[key] = attribute.GetMetadata(key)
    times = attribute.GetTimeSamples()
    if not times:
        described["default"] = _value(attribute.Get())
        return described
    described["times"] = times
    samples = [_value(attribute.Get(time)) for time in times]
    described["samples"] = samples
    if described["type"].startswith("quat"):
        signed = np.stack([_quats_wxyz(attribute.Get(time)) for time in times])
        described["sign_continuous"] = is_sign_continuous(signed)
    return described


def _value(value: object) -> object:
    """Turn one USD value into numbers, strings and lists; quaternions into w, x, y, z."""
    from pxr import Gf, Sdf, Vt

    quats = (Gf.Quatd, Gf.Quatf, Gf.Quath, Vt.QuatdArray, Vt.QuatfArray, Vt.QuathArray)
    if isinstance(value, quats):
        return fix_signs(_quats_wxyz(value))
    if isinstance(value, Vt.TokenArray | Vt.StringArray):
        return [str(item) for item in value]
    if isinstance(value, Sdf.AssetPath):
        return value.path
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return np.array(value)


def _quats_wxyz(value: object) -> np.ndarray:
    """Read the parts by name: no assumption about the order in memory."""
    quats = value if hasattr(value, "__len__") else [value]
    return np.array([[quat.GetReal(), *quat.GetImaginary()] for quat in quats], dtype=np.float64)
