"""Each rule for USD catches a file broken in that one way, and names the place."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from exporters import export_clip
from exporters.check import check_file
from exporters.check.usd import guarded
from tests.helpers import clips

GAUSSIANS, JOINTS = 8, 5
SKEL, ANIM, MESH, SPLATS = "/random/Skel", "/random/Skel/Anim", "/random/Carrier", "/random/Splats"


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("good")
    clip = clips.random(gaussians=GAUSSIANS, joints=JOINTS, keys=4)
    for name in ("clip.usda", "clip_gaussians.usda"):
        export_clip(clip, folder / name)
        assert check_file(folder / name, is_trusted=True) == ()
    return folder


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


RIG_EDITS: dict[str, tuple[Edit, str]] = {
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

CACHE_EDITS: dict[str, tuple[Edit, str]] = {
    "short orientations": (
        attribute(SPLATS, "orientations", shorter, sample=2),
        f"{SPLATS}.orientations at 2: expected 8 values, 1 for each of 8 Gaussians, found 7",
    ),
    "short scales": (
        attribute(SPLATS, "scales", shorter),
        f"{SPLATS}.scales at 0: expected 8 values, 1 for each of 8 Gaussians, found 7",
    ),
    "no opacities": (
        without(SPLATS, "opacities"),
        f"{SPLATS}.opacities at 0: expected 8 values, 1 for each of 8 Gaussians, found 0",
    ),
    "short harmonics": (
        attribute(SPLATS, "radiance:sphericalHarmonicsCoefficients", lambda sh: sh[:-16]),
        f"{SPLATS}.radiance:sphericalHarmonicsCoefficients at 0: expected 128 values, 16 for each of 8 "
        "Gaussians, found 112",
    ),
    "harmonics of another degree": (
        lambda stage: stage.GetAttributeAtPath(f"{SPLATS}.radiance:sphericalHarmonicsDegree").Set(
            2
        ),
        f"{SPLATS}.radiance:sphericalHarmonicsCoefficients at 0: expected 72 values, 9 for each",
    ),
    "degree": (
        lambda stage: stage.GetAttributeAtPath(f"{SPLATS}.radiance:sphericalHarmonicsDegree").Set(
            7
        ),
        f"{SPLATS}.radiance:sphericalHarmonicsDegree: expected a degree of 0..4, found 7",
    ),
    "another number of positions": (
        attribute(SPLATS, "positions", shorter, sample=1),
        f"{SPLATS}.positions at 1: expected 8 positions, the same number in all samples, found 7",
    ),
    "no positions": (
        without(SPLATS, "positions"),
        f"{SPLATS}.positions at 0: expected some positions, the same number in all samples, found 0",
    ),
    "log scales": (
        attribute(SPLATS, "scales", np.log),
        f"{SPLATS}.scales at 0: expected linear scales > 0, found 8 Gaussians with others; are these",
    ),
    "logits": (
        attribute(SPLATS, "opacities", put(3, -0.25)),
        f"{SPLATS}.opacities at 0: expected opacities in 0..1, found 1 Gaussians outside",
    ),
    "long orientation": (
        attribute(SPLATS, "orientations", put(3, [1, 1, 1, 1]), sample=1),
        f"{SPLATS}.orientations at 1: expected unit quaternions, found 1",
    ),
    "sign jump": (
        attribute(SPLATS, "orientations", lambda quats: -quats, sample=2),
        f"{SPLATS}.orientations at 2: expected quaternions on the side of those a key before",
    ),
    "not finite": (
        attribute(SPLATS, "positions", put((4, 2), np.inf), sample=1),
        f"{SPLATS}.positions at 1: expected finite numbers",
    ),
    "no extent": (
        without(SPLATS, "extent"),
        f"{SPLATS}.extent at 0: expected an extent of two corners, found 0 corners",
    ),
    "extent of the centers": (
        lambda stage: attribute(
            SPLATS,
            "extent",
            lambda box: np.stack(
                [
                    np.array(stage.GetAttributeAtPath(f"{SPLATS}.positions").Get(2)).min(axis=0),
                    np.array(stage.GetAttributeAtPath(f"{SPLATS}.positions").Get(2)).max(axis=0),
                ]
            ),
            sample=2,
        )(stage),
        f"{SPLATS}.extent at 2: expected a box around all 3-sigma ellipsoids, found",
    ),
}
"""By name: what is done to a good file, and the beginning of what must be said."""


@pytest.mark.parametrize(
    ("file", "mistake"),
    [("clip.usda", name) for name in RIG_EDITS]
    + [("clip_gaussians.usda", name) for name in CACHE_EDITS],
)
def test_a_broken_stage_is_caught_in_its_place(
    file: str, mistake: str, good: Path, tmp_path: Path
) -> None:
    edit, expected = (RIG_EDITS if file == "clip.usda" else CACHE_EDITS)[mistake]
    path = tmp_path / file
    path.write_bytes((good / file).read_bytes())
    stage = Usd.Stage.Open(str(path))
    edit(stage)
    stage.Save()
    del stage
    said = [str(problem) for problem in check_file(path, is_trusted=True)]
    assert any(line.startswith(expected) for line in said), said


def test_half_arrays_count_where_there_are_no_floats(good: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip_gaussians.usda"
    path.write_bytes((good / path.name).read_bytes())
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath(SPLATS)
    scales = np.array(prim.GetAttribute("scales").Get()).astype(np.float16)
    prim.RemoveProperty("scales")
    prim.GetAttribute("scalesh").Set(Vt.Vec3hArray.FromNumpy(scales))
    stage.Save()
    assert check_file(path, is_trusted=True) == ()
    prim.GetAttribute("scalesh").Set(Vt.Vec3hArray.FromNumpy(-scales))
    stage.Save()
    (problem,) = check_file(path, is_trusted=True)
    assert problem.place == f"{SPLATS}.scalesh at 0"


def test_a_payload_is_checked_with_the_file_that_names_it(good: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip_gaussians.usda"
    path.write_bytes((good / path.name).read_bytes())
    inner = Usd.Stage.Open(str(path))
    attribute(SPLATS, "scales", np.log)(inner)
    inner.Save()
    outer = Usd.Stage.CreateNew(str(tmp_path / "outer.usda"))
    prim = UsdGeom.Xform.Define(outer, "/Lamp").GetPrim()
    prim.GetPayloads().AddPayload("./clip_gaussians.usda")
    outer.Save()
    said = [str(problem) for problem in check_file(tmp_path / "outer.usda", is_trusted=True)]
    assert any(line.startswith("/Lamp/Splats.scales") for line in said), said


@pytest.mark.parametrize("content", [b"", b"#usda 1.0\n(", b"PXR-USDC" + b"x" * 200, b"\xff\xfe"])
def test_no_stage_at_all_is_a_problem(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "clip.usd").write_bytes(content)
    (problem,) = check_file(tmp_path / "clip.usd", is_trusted=True)
    assert str(problem).startswith("stage: expected a file that USD can read, found ")


def test_a_foreign_file_is_read_in_another_process(good: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip.usda"
    path.write_text((good / "clip.usda").read_text().replace("metersPerUnit = 1", ""))
    assert check_file(path) == check_file(path, is_trusted=True) != ()


def test_a_crash_of_usd_is_a_problem(
    good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dies = [sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"]
    run = subprocess.run
    monkeypatch.setattr(guarded.subprocess, "run", lambda command, **options: run(dies, **options))
    (problem,) = check_file(good / "clip.usda")
    assert str(problem) == (
        "stage: expected a file that USD can read, found one it dies of (Segmentation fault)"
    )
