"""A skinned mesh, which carries the rig into tools that do not skin Gaussians: all of them."""

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel

from exporters import bounds
from exporters.skinned_mesh import INFLUENCES, SkinnedMesh
from exporters.usd import values


def define_skinned_mesh(
    stage: Usd.Stage, skinned: SkinnedMesh, path: str, skeleton: UsdSkel.Skeleton
) -> UsdGeom.Mesh:
    """Define a mesh at `path`, bound to the skeleton by classic linear blending.

    Only a closed surface gets normals, which make it smooth: the quads of the carrier are flat. Its
    inside is never seen, and it is opaque, which a tool need not find out by reading opacities.
    """
    mesh = UsdGeom.Mesh.Define(stage, path)
    face_count, corner_count = skinned.faces.shape
    mesh.CreatePointsAttr(values.vectors(skinned.positions))
    mesh.CreateFaceVertexCountsAttr(values.ints(np.full(face_count, corner_count, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(values.ints(skinned.faces.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(not skinned.is_closed)
    mesh.CreateExtentAttr(values.vectors(bounds.point_extent(skinned.positions)))
    colors = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    colors.Set(values.vectors(skinned.colors_linear))
    if skinned.is_closed:
        mesh.CreateNormalsAttr(values.vectors(skinned.normals))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    else:
        opacities = mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.vertex)
        opacities.Set(values.floats(skinned.opacities))

    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    joint_ids = binding.CreateJointIndicesPrimvar(False, INFLUENCES)
    joint_ids.Set(values.ints(skinned.joint_ids.ravel()))
    weights = binding.CreateJointWeightsPrimvar(False, INFLUENCES)
    weights.Set(values.floats(skinned.weights.ravel()))
    return mesh
