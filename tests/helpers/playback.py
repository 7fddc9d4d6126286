"""Where the Gaussians are according to an exported file, in meters, Y-up, at a time in seconds.

Played by readers that share no code with the exporters: `tests.helpers.gltf_reader` and UsdSkel.
"""

from pathlib import Path

import numpy as np

from exporters.clip import Clip
from tests.helpers import gltf_reader


def to_y_up_meters(points: np.ndarray, *, up_axis: str, meters_per_unit: float) -> np.ndarray:
    """Convert points, shape (..., 3); a Z-up scene is laid back: (x, y, z) to (x, z, -y)."""
    if up_axis == "Z":
        points = np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)
    return points * meters_per_unit


def clip_centers(clip: Clip, time_s: float) -> np.ndarray:
    """Return the truth, shape (N, 3)."""
    positions = clip.pose_at(time_s).positions.astype(np.float64)
    return to_y_up_meters(positions, up_axis=clip.up_axis, meters_per_unit=clip.meters_per_unit)


def gltf_centers(path: Path, time_s: float) -> np.ndarray:
    """Return the centers of the carrier's quads in a glTF file, shape (N, 3)."""
    vertices = gltf_reader.read(path).skinned_positions("carrier", time_s)
    return vertices.reshape(-1, 4, 3).mean(axis=1)


def usd_centers(path: Path, time_s: float) -> np.ndarray:
    """Return the centers of the carrier's quads in a USD file, shape (N, 3)."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    vertices = usd_skinned_points(stage, time_s * stage.GetTimeCodesPerSecond())
    return to_y_up_meters(
        vertices.reshape(-1, 4, 3).mean(axis=1),
        up_axis=str(UsdGeom.GetStageUpAxis(stage)),
        meters_per_unit=UsdGeom.GetStageMetersPerUnit(stage),
    )


def usd_skinned_points(stage: object, time_code: float) -> np.ndarray:
    """Return the world points of the only skinned mesh of a stage, in stage units, shape (V, 3)."""
    from pxr import Usd, UsdGeom, UsdSkel

    (root,) = [prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Root)]
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(root), Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(UsdSkel.Root(root), Usd.PrimDefaultPredicate)
    (target,) = binding.GetSkinningTargets()
    skeleton = binding.GetSkeleton()
    transforms = cache.GetSkelQuery(skeleton).ComputeSkinningTransforms(time_code)
    points = UsdGeom.Mesh(target.GetPrim()).GetPointsAttr().Get()
    assert target.ComputeSkinnedPoints(transforms, points, time_code)
    to_world = UsdGeom.Xformable(skeleton).ComputeLocalToWorldTransform(time_code)
    # Gf matrices act on row vectors.
    homogeneous = np.concatenate([np.array(points), np.ones((len(points), 1))], axis=1)
    return (homogeneous @ np.array(to_world))[:, :3]
