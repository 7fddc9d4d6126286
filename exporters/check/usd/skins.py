"""Rules for skinned prims (UsdSkelBindingAPI, "Skinning")."""

from collections.abc import Iterator

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from exporters.check import gaussians, influences
from exporters.check.problem import Problem
from exporters.check.usd.values import place, rows

_INTERPOLATIONS = (UsdGeom.Tokens.vertex, UsdGeom.Tokens.constant)
_POSED_POINTS = 256
_POSED_TIMES = 16


def skin_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Hold every prim with joint influences to the rules."""
    for prim in stage.Traverse():
        binding = UsdSkel.BindingAPI(prim)
        indices, weights = binding.GetJointIndicesPrimvar(), binding.GetJointWeightsPrimvar()
        if not (indices.HasAuthoredValue() or weights.HasAuthoredValue()):
            continue
        if not prim.HasAPI(UsdSkel.BindingAPI):
            yield Problem(
                place=str(prim.GetPath()), expected="SkelBindingAPI", found="none applied"
            )
        if not UsdSkel.Root.Find(prim):
            yield Problem(place=str(prim.GetPath()), expected="a SkelRoot above", found="none")
        skeleton = binding.GetInheritedSkeleton()
        if not skeleton:
            expected = "a skel:skeleton that is there"
            yield Problem(place=str(prim.GetPath()), expected=expected, found="none")
            continue
        joints = binding.GetJointsAttr().Get() or skeleton.GetJointsAttr().Get() or []
        layout = [*layout_problems(indices, weights, _point_count(prim))]
        yield from layout or _influence_problems(indices, weights, len(joints))


def layout_problems(
    indices: UsdGeom.Primvar, weights: UsdGeom.Primvar, point_count: int | None
) -> Iterator[Problem]:
    """Indices and weights have one elementSize, and that many values a point.

    Args:
        indices: primvars:skel:jointIndices.
        weights: primvars:skel:jointWeights.
        point_count: Number of points; None if the prim has none.
    """
    size = indices.GetElementSize()
    if weights.GetElementSize() != size or size < 1:
        yield Problem(
            place=f"{place(weights.GetAttr())} elementSize",
            expected=f"{size}, that of jointIndices, and at least 1",
            found=str(weights.GetElementSize()),
        )
        return
    for primvar in (indices, weights):
        where = place(primvar.GetAttr())
        interpolation = primvar.GetInterpolation()
        if interpolation not in _INTERPOLATIONS or interpolation != indices.GetInterpolation():
            expected = " or ".join(_INTERPOLATIONS) + ", the same for both"
            yield Problem(place=f"{where} interpolation", expected=expected, found=interpolation)
            continue
        values = rows(primvar.GetAttr())
        found = 0 if values is None else len(values)
        elements = 1 if interpolation == UsdGeom.Tokens.constant else point_count
        if elements is not None and found != elements * size:
            expected = f"{elements * size} values, {size} for each of {elements}"
            yield Problem(place=where, expected=expected, found=str(found))


def _influence_problems(
    indices: UsdGeom.Primvar, weights: UsdGeom.Primvar, joint_count: int
) -> Iterator[Problem]:
    size = indices.GetElementSize()
    joint_ids = rows(indices.GetAttr()).reshape(-1, size)
    weight_rows = rows(weights.GetAttr()).reshape(-1, size)
    yield from influences.joint_indices(place(indices.GetAttr()), joint_ids, joint_count)
    yield from influences.weights(place(weights.GetAttr()), weight_rows)
    if len(joint_ids) == len(weight_rows):
        where = place(indices.GetAttr())
        yield from influences.distinct_joints(where, joint_ids, weight_rows)


def root_extent_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """The extent of a SkelRoot holds its skinned meshes at all times (UsdSkelRoot).

    Looked at are up to 256 points of each mesh at up to 16 times, posed by UsdSkel.
    """
    for prim in stage.Traverse():
        if not prim.IsA(UsdSkel.Root):
            continue
        root = UsdSkel.Root(prim)
        if root.GetExtentAttr().Get() is None:
            yield Problem(place=place(root.GetExtentAttr()), expected="an extent", found="none")
            continue
        cache = UsdSkel.Cache()
        cache.Populate(root, Usd.PrimDefaultPredicate)
        for binding in cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate):
            query = cache.GetSkelQuery(binding.GetSkeleton())
            for target in binding.GetSkinningTargets():
                yield from _posed_problems(root, query, target)


def _posed_problems(
    root: UsdSkel.Root, query: UsdSkel.SkeletonQuery, target: UsdSkel.SkinningQuery
) -> Iterator[Problem]:
    mesh = UsdGeom.Mesh(target.GetPrim())
    if not mesh or not target.HasJointInfluences():
        return
    points = rows(mesh.GetPointsAttr())
    size = target.GetNumInfluencesPerComponent()
    if points is None or target.IsRigidlyDeformed():
        return
    chosen = slice(None, None, -(-len(points) // _POSED_POINTS))
    joint_ids = rows(target.GetJointIndicesPrimvar().GetAttr()).reshape(-1, size)[chosen]
    weights = rows(target.GetJointWeightsPrimvar().GetAttr()).reshape(-1, size)[chosen]
    bind = np.array(target.GetGeomBindTransform(Usd.TimeCode.Default()))
    rest = np.append(points[chosen], np.ones((len(joint_ids), 1)), axis=1) @ bind
    mapper = target.GetJointMapper()
    times = query.GetAnimQuery().GetJointTransformTimeSamples() if query.GetAnimQuery() else []
    extent_attribute = root.GetExtentAttr()
    for code in times[:: -(-len(times) // _POSED_TIMES) or 1] or [0.0]:
        time = Usd.TimeCode(code)
        transforms = query.ComputeSkinningTransforms(time)
        if mapper:
            transforms = mapper.RemapTransforms(transforms)
        matrices = np.asarray(transforms)
        if joint_ids.size == 0 or len(matrices) <= joint_ids.max() or joint_ids.min() < 0:
            return  # said by the rules of influences
        blended = np.einsum("vk,vkij->vij", weights, matrices[joint_ids])
        posed = np.einsum("vi,vij->vj", rest, blended)[:, :3]
        where = place(extent_attribute, time)
        extent = rows(extent_attribute, time)
        problems = [*gaussians.points_in_extent(where, extent, posed)]
        yield from problems
        if problems:
            return


def _point_count(prim: Usd.Prim) -> int | None:
    if not prim.IsA(UsdGeom.PointBased):
        return None
    points = rows(UsdGeom.PointBased(prim).GetPointsAttr())
    return 0 if points is None else len(points)
