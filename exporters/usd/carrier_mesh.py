"""The skinned mesh that carries the rig into tools that do not skin Gaussians: all of them."""

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel

from exporters import bounds
from exporters.carrier import VERTICES_PER_SPLAT, carrier_quads, per_vertex
from exporters.clip import Clip
from exporters.usd import values


def define_carrier_mesh(
    stage: Usd.Stage, clip: Clip, path: str, skeleton: UsdSkel.Skeleton
) -> UsdGeom.Mesh:
    """Define one oriented quad a Gaussian at `path`, bound to the skeleton.

    Quad i has the points 4i .. 4i+3. Weights are normalized again in float64, since a tool that
    does not normalize them would differ from one that does; skinning is classic linear blending.
    """
    quads = carrier_quads(clip.splats)
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(values.vectors(quads.positions))
    mesh.CreateFaceVertexCountsAttr(
        values.ints(np.full(len(clip.splats), VERTICES_PER_SPLAT, np.int32))
    )
    mesh.CreateFaceVertexIndicesAttr(values.ints(quads.quads.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    mesh.CreateExtentAttr(values.vectors(bounds.point_extent(quads.positions)))
    colors = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    colors.Set(values.vectors(quads.colors_linear))
    opacities = mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.vertex)
    opacities.Set(values.floats(quads.opacities))

    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    influences = clip.skin.joint_ids.shape[1]
    weights = clip.skin.weights / clip.skin.weights.sum(axis=1, keepdims=True, dtype=np.float64)
    joint_ids = np.where(weights > 0, clip.skin.joint_ids, 0)
    binding.CreateJointIndicesPrimvar(False, influences).Set(
        values.ints(per_vertex(joint_ids).ravel())
    )
    binding.CreateJointWeightsPrimvar(False, influences).Set(
        values.floats(per_vertex(weights).ravel())
    )
    return mesh
