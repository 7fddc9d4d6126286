"""Rules for skinned prims (UsdSkelBindingAPI, "Skinning")."""

from collections.abc import Iterator

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from exporters.check import gaussians, influences
from exporters.check.problem import Problem
from exporters.check.usd.values import first_rows, place, rows

_INTERPOLATIONS = (UsdGeom.Tokens.vertex, UsdGeom.Tokens.constant)
POSED_POINTS, POSED_TIMES = 1024, 16
"""At how many points and keys the extent of a SkelRoot is compared with each of its meshes."""


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
        found = len(rows(primvar.GetAttr()))
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

    Looked at are some of the points at some of the keys: it is cheap, and a box that was not
    computed for the motion fails by far.
    """
    for prim in stage.Traverse():
        if not prim.IsA(UsdSkel.Root):
            continue
        root = UsdSkel.Root(prim)
        if len(rows(root.GetExtentAttr())) != 2:
            yield Problem(
                place=place(root.GetExtentAttr()),
                expected="an extent of two corners",
                found="none",
            )
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
    # Matrices of USD act on row vectors.
    points = first_rows(mesh.GetPointsAttr())
    chosen = slice(None, None, max(-(-len(points) // POSED_POINTS), 1))
    joint_ids, weights = (
        np.asarray(each).reshape(len(points), -1)[chosen]
        for each in target.ComputeVaryingJointInfluences(len(points))
    )
    bind = np.array(target.GetGeomBindTransform())
    bound = points[chosen] @ bind[:3, :3] + bind[3, :3]
    to_root = np.array(
        UsdGeom.XformCache().ComputeRelativeTransform(query.GetPrim(), root.GetPrim())[0]
    )
    mapper = target.GetJointMapper()
    animation = query.GetAnimQuery()
    times = animation.GetJointTransformTimeSamples() if animation else []
    for code in times[:: max(-(-len(times) // POSED_TIMES), 1)] or [0.0]:
        time = Usd.TimeCode(code)
        transforms = query.ComputeSkinningTransforms(time)
        matrices = (
            np.asarray(mapper.RemapTransforms(transforms) if mapper else transforms) @ to_root
        )
        blended = np.einsum("vk,vkij->vij", weights, matrices[joint_ids])
        posed = np.einsum("vi,vij->vj", bound, blended[:, :3, :3]) + blended[:, 3, :3]
        where = place(root.GetExtentAttr(), time)
        problems = [*gaussians.points_in_extent(where, rows(root.GetExtentAttr(), time), posed)]
        yield from problems
        if problems:
            return


def _point_count(prim: Usd.Prim) -> int | None:
    is_point_based = prim.IsA(UsdGeom.PointBased)
    return len(first_rows(UsdGeom.PointBased(prim).GetPointsAttr())) if is_point_based else None
