"""Each rule for stages, skeletons, meshes and skins catches a USD rig broken in that one way."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, UsdSkel

from exporters.check import check_file
from tests.check.usd_edits import (
    ANIM,
    JOINTS,
    MESH,
    SKEL,
    Edit,
    attribute,
    good_usda,
    joints,
    late_start,
    metadata,
    other_type,
    payload,
    put,
    repeat_joint,
    said_of,
    shorter,
    texture,
    without,
)

EDITS: dict[str, tuple[Edit, str]] = {
    # stage
    "no axis": (
        lambda stage: stage.ClearMetadata("upAxis"),
        "stage: expected upAxis, found nothing",
    ),
    "no unit": (
        lambda stage: stage.ClearMetadata("metersPerUnit"),
        "stage: expected metersPerUnit, found nothing",
    ),
    "no length": (
        lambda stage: stage.SetMetadata("metersPerUnit", 0.0),
        "stage: expected metersPerUnit > 0, found 0",
    ),
    "no rate": (
        lambda stage: stage.ClearMetadata("timeCodesPerSecond"),
        "stage: expected timeCodesPerSecond > 0",
    ),
    "no default prim": (
        lambda stage: stage.ClearDefaultPrim(),
        "stage: expected a defaultPrim, found none",
    ),
    "default prim that is none": (
        lambda stage: stage.GetRootLayer().__setattr__("defaultPrim", "gone"),
        "stage: expected a defaultPrim, found one that is not there",
    ),
    "start at 1": (
        lambda stage: stage.SetStartTimeCode(1.0),
        "stage: expected startTimeCode 0, and endTimeCode not below, found 1 and",
    ),
    "late start": (late_start, "stage: expected a first sample at 0, found one at 1"),
    "early end": (
        lambda stage: stage.SetEndTimeCode(1.0),
        f"{ANIM}.translations: expected samples in 0..1, the stage's time codes, found samples in 0..",
    ),
    "payload that is not there": (
        payload("./gone.usdc"),
        "stage: expected layers that can be composed, found",
    ),
    "payload outside": (
        payload("../secret.usdc"),
        "clip.usda: expected paths of files in its folder, found '../secret.usdc'",
    ),
    "payload anywhere": (
        payload("/etc/passwd.usda"),
        "clip.usda: expected paths of files in its folder, found '/etc/passwd.usda'",
    ),
    "texture that is not there": (
        texture,
        "/random.file: expected a file that is there, found 'gone.png'",
    ),
    "type": (
        other_type,
        f"{MESH}.points: expected point3f[], found float[] in clip.usda",
    ),
    # values
    "not finite": (
        attribute(ANIM, "translations", put((2, 1), np.nan), sample=1),
        f"{ANIM}.translations at 2: expected finite numbers, found 1 numbers that are not finite "
        "(first at (2, 1))",
    ),
    "not finite, one number": (
        lambda stage: stage.GetAttributeAtPath("/random/Camera.focalLength").Set(float("inf")),
        "/random/Camera.focalLength: expected finite numbers",
    ),
    "long rotation": (
        attribute(ANIM, "rotations", put(3, [0, 0, 1, 1])),
        f"{ANIM}.rotations at 0: expected unit quaternions, found 1 quaternions of another length "
        "(first at 3)",
    ),
    "sign jump": (
        attribute(ANIM, "rotations", lambda quats: -quats, sample=1),
        f"{ANIM}.rotations at 2: expected quaternions on the side of those a key before, found 5",
    ),
    "camera rotation": (
        lambda stage: stage.GetAttributeAtPath("/random/Camera.xformOp:orient").Set(
            Gf.Quatd(2, 0, 0, 0), 0
        ),
        "/random/Camera.xformOp:orient at 0: expected unit quaternions",
    ),
    # skeleton
    "no joints": (
        joints(SKEL, lambda names: []),
        f"{SKEL}.joints: expected at least one joint, found none",
    ),
    "joint twice": (
        joints(SKEL, lambda names: [*names[:-1], names[1]]),
        f"{SKEL}.joints: expected different joints, found 1 more than once",
    ),
    "children first": (
        joints(SKEL, lambda names: names[::-1]),
        f"{SKEL}.joints: expected parents before children, found",
    ),
    "two roots": (
        joints(SKEL, lambda names: [*names[:-1], "other"]),
        f"{SKEL}.joints: expected one root joint, found 2 (root, other)",
    ),
    "last names": (
        joints(SKEL, lambda names: [*names[:-1], "root/joint_1/root"]),
        f"{SKEL}.joints: expected different last names, found 1 more than once (root)",
    ),
    "fewer bind matrices": (
        attribute(SKEL, "bindTransforms", shorter),
        f"{SKEL}.bindTransforms: expected 5 matrices, one a joint, found 4",
    ),
    "no bind matrices": (
        without(SKEL, "bindTransforms"),
        f"{SKEL}.bindTransforms: expected 5 matrices, one a joint, found 0",
    ),
    "no rest matrices": (
        without(SKEL, "restTransforms"),
        f"{SKEL}.restTransforms: expected 5 matrices, one a joint, found 0",
    ),
    "transposed": (
        attribute(SKEL, "bindTransforms", lambda matrices: matrices.swapaxes(1, 2)),
        f"{SKEL}.bindTransforms: expected matrices with last column 0 0 0 1; are they transposed?",
    ),
    "flat matrix": (
        attribute(SKEL, "restTransforms", put((1, 0), 0.0)),
        f"{SKEL}.restTransforms: expected matrices that can be inverted, found 1",
    ),
    "animation that is none": (
        lambda stage: (
            UsdSkel.BindingAPI(stage.GetPrimAtPath(SKEL))
            .GetAnimationSourceRel()
            .SetTargets(["/random/gone"])
        ),
        f"{SKEL}.skel:animationSource: expected a SkelAnimation, found none at /random/gone",
    ),
    "animation of other joints": (
        joints(ANIM, lambda names: [*names[:-1], "other"]),
        f"{ANIM}.joints: expected joints of {SKEL}, found 1 others (other)",
    ),
    "no scales": (
        without(ANIM, "scales"),
        f"{ANIM}.scales: expected 5 values, one a joint, found 0",
    ),
    "short translations": (
        attribute(ANIM, "translations", shorter, sample=2),
        f"{ANIM}.translations at ",
    ),
    "short rotations": (
        attribute(ANIM, "rotations", shorter, sample=0),
        f"{ANIM}.rotations at 0: expected 5 values, one a joint, found 4",
    ),
    # mesh
    "no points": (without(MESH, "points"), f"{MESH}.points: expected points, found none"),
    "no faces": (without(MESH, "faceVertexCounts"), f"{MESH}: expected faces, found none"),
    "two corners": (
        attribute(MESH, "faceVertexCounts", put(3, 2)),
        f"{MESH}.faceVertexCounts: expected three or more corners a face, found 1 faces with fewer "
        "(first at 3)",
    ),
    "corners in all": (
        attribute(MESH, "faceVertexCounts", shorter),
        f"{MESH}.faceVertexCounts: expected a sum of 32, the number of faceVertexIndices, found 28",
    ),
    "index of no point": (
        attribute(MESH, "faceVertexIndices", put(5, 32)),
        f"{MESH}.faceVertexIndices: expected points 0..31, found 1 indices of others (first at 5)",
    ),
    "negative index": (
        attribute(MESH, "faceVertexIndices", put(5, -1)),
        f"{MESH}.faceVertexIndices: expected points 0..31",
    ),
    "no extent": (
        without(MESH, "extent"),
        f"{MESH}.extent: expected an extent of two corners, found 0 corners",
    ),
    "small extent": (
        attribute(MESH, "extent", lambda box: box * 0.9),
        f"{MESH}.extent: expected a box around all points, found",
    ),
    "short colors": (
        attribute(MESH, "primvars:displayColor", shorter),
        f"{MESH}.primvars:displayColor: expected 32 values (vertex, 1 each), found 31",
    ),
    # skin
    "joint out of range": (
        attribute(MESH, "primvars:skel:jointIndices", put(9, JOINTS)),
        f"{MESH}.primvars:skel:jointIndices: expected joints 0..4, found 1 vertices with another joint "
        "(first at 2)",
    ),
    "negative joint": (
        attribute(MESH, "primvars:skel:jointIndices", put(9, -1)),
        f"{MESH}.primvars:skel:jointIndices: expected joints 0..4",
    ),
    "weights scaled": (
        attribute(MESH, "primvars:skel:jointWeights", lambda weights: weights * 0.9),
        f"{MESH}.primvars:skel:jointWeights: expected weights that sum to 1, found 32 vertices",
    ),
    "negative weight": (
        attribute(MESH, "primvars:skel:jointWeights", put(slice(0, 4), [1.5, -0.5, 0, 0])),
        f"{MESH}.primvars:skel:jointWeights: expected weights >= 0",
    ),
    "a joint twice in a vertex": (
        repeat_joint,
        f"{MESH}.primvars:skel:jointIndices: expected different joints in a vertex, found 1",
    ),
    "short weights": (
        attribute(MESH, "primvars:skel:jointWeights", lambda weights: weights[:-4]),
        f"{MESH}.primvars:skel:jointWeights: expected 128 values, 4 for each of 32, found 124",
    ),
    "short indices": (
        attribute(MESH, "primvars:skel:jointIndices", lambda indices: indices[:-4]),
        f"{MESH}.primvars:skel:jointIndices: expected 128 values, 4 for each of 32, found 124",
    ),
    "element size": (
        metadata(MESH, "primvars:skel:jointWeights", "elementSize", 2),
        f"{MESH}.primvars:skel:jointWeights elementSize: expected 4, that of jointIndices, and at least "
        "1, found 2",
    ),
    "interpolation": (
        metadata(MESH, "primvars:skel:jointWeights", "interpolation", "uniform"),
        f"{MESH}.primvars:skel:jointWeights interpolation: expected vertex or constant, the same for "
        "both, found uniform",
    ),
    "no skeleton": (
        lambda stage: UsdSkel.BindingAPI(stage.GetPrimAtPath(MESH)).GetSkeletonRel().SetTargets([]),
        f"{MESH}: expected a skel:skeleton that is there, found none",
    ),
    "no skeleton API": (
        lambda stage: stage.GetPrimAtPath(MESH).RemoveAPI(UsdSkel.BindingAPI),
        f"{MESH}: expected SkelBindingAPI, found none applied",
    ),
    "no root": (
        lambda stage: stage.GetPrimAtPath("/random").SetTypeName("Xform"),
        f"{MESH}: expected a SkelRoot above, found none",
    ),
    "no extent of the motion": (
        without("/random", "extent"),
        "/random.extent: expected an extent of two corners, found none",
    ),
    "rest extent for the motion": (
        attribute("/random", "extent", lambda box: box * 0.3),
        "/random.extent at 0: expected a box around all points, found",
    ),
}
"""By name: what is done to a good file, and the beginning of what must be said."""


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = good_usda(tmp_path_factory.mktemp("good") / "clip.usda")
    assert check_file(path, is_trusted=True) == ()
    return path


@pytest.mark.parametrize("mistake", EDITS)
def test_a_broken_rig_is_caught_in_its_place(mistake: str, good: Path, tmp_path: Path) -> None:
    edit, expected = EDITS[mistake]
    said = said_of(good, edit, tmp_path / good.name)
    assert any(line.startswith(expected) for line in said), said
