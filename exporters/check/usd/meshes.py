"""Rules for meshes (UsdGeomMesh, UsdGeomPrimvar, UsdGeomBoundable)."""

from collections.abc import Iterator

import numpy as np
from pxr import Usd, UsdGeom

from exporters.check import gaussians
from exporters.check.problem import Problem, count_bad
from exporters.check.usd.values import first_rows, place, rows, sample_times


def mesh_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Hold every mesh of a stage to the rules."""
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        mesh = UsdGeom.Mesh(prim)
        points = first_rows(mesh.GetPointsAttr())
        if len(points) == 0:
            where = place(mesh.GetPointsAttr())
            yield Problem(place=where, expected="points", found="none")
            continue
        counts = first_rows(mesh.GetFaceVertexCountsAttr())
        indices = first_rows(mesh.GetFaceVertexIndicesAttr())
        if len(counts) == 0 or len(indices) == 0:
            yield Problem(place=str(prim.GetPath()), expected="faces", found="none")
            continue
        yield from face_count_problems(place(mesh.GetFaceVertexCountsAttr()), counts, len(indices))
        where = place(mesh.GetFaceVertexIndicesAttr())
        yield from face_index_problems(where, indices, len(points))
        yield from extent_problems(mesh)
        sizes = {
            UsdGeom.Tokens.constant: 1,
            UsdGeom.Tokens.uniform: len(counts),
            UsdGeom.Tokens.vertex: len(points),
            UsdGeom.Tokens.varying: len(points),
            UsdGeom.Tokens.faceVarying: len(indices),
        }
        for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithAuthoredValues():
            yield from primvar_problems(primvar, sizes)
        normals = mesh.GetNormalsAttr()
        if normals.HasAuthoredValue():
            found = len(first_rows(normals))
            expected = sizes[mesh.GetNormalsInterpolation()]
            if found != expected:
                yield Problem(place=place(normals), expected=f"{expected} values", found=str(found))


def face_count_problems(where: str, counts: np.ndarray, index_count: int) -> Iterator[Problem]:
    """Faces have three corners or more, and as many in all as there are indices.

    Args:
        where: Where the counts are.
        counts: Corners of each face, shape (F,).
        index_count: Length of faceVertexIndices.
    """
    yield from count_bad(
        where, counts < 3, expected="three or more corners a face", what="faces with fewer"
    )
    total = int(counts.sum(dtype=np.int64))
    if total != index_count:
        expected = f"a sum of {index_count}, the number of faceVertexIndices"
        yield Problem(place=where, expected=expected, found=str(total))


def face_index_problems(where: str, indices: np.ndarray, point_count: int) -> Iterator[Problem]:
    """Every face index names a point.

    Args:
        where: Where they are.
        indices: Shape (M,).
        point_count: Number of points.
    """
    yield from count_bad(
        where,
        (indices < 0) | (indices >= point_count),
        expected=f"points 0..{point_count - 1}",
        what="indices of others",
    )


def extent_problems(gprim: UsdGeom.PointBased) -> Iterator[Problem]:
    """The extent is authored and holds the points, before any skin (UsdGeomBoundable)."""
    extent_attribute, points_attribute = gprim.GetExtentAttr(), gprim.GetPointsAttr()
    for time in sample_times([points_attribute]):
        extent = rows(extent_attribute, time)
        where = place(extent_attribute, time)
        if len(extent) != 2:
            found = f"{len(extent)} corners"
            yield Problem(place=where, expected="an extent of two corners", found=found)
            return
        problems = [*gaussians.points_in_extent(where, extent, rows(points_attribute, time))]
        yield from problems
        if problems:
            return


def primvar_problems(primvar: UsdGeom.Primvar, sizes: dict[str, int]) -> Iterator[Problem]:
    """A primvar has the number of values that its interpolation and elementSize ask for.

    Args:
        primvar: With a value.
        sizes: Number of elements of the mesh, by interpolation.
    """
    attribute = primvar.GetAttr()
    if not primvar.GetTypeName().isArray or primvar.IsIndexed():
        return
    interpolation, size = primvar.GetInterpolation(), primvar.GetElementSize()
    if size < 1 or interpolation not in sizes:
        found = f"elementSize {size}, interpolation {interpolation}"
        yield Problem(place=place(attribute), expected="elementSize >= 1", found=found)
        return
    expected, found = sizes[interpolation] * size, len(first_rows(attribute))
    if found != expected:
        described = f"{expected} values ({interpolation}, {size} each)"
        yield Problem(place=place(attribute), expected=described, found=str(found))
