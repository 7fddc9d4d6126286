"""Each rule for splats catches a USD cache broken in that one way."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from exporters.check import check_file
from tests.check.usd_edits import (
    SPLATS,
    Edit,
    attribute,
    good_usda,
    put,
    said_of,
    shorter,
    without,
)

EDITS: dict[str, tuple[Edit, str]] = {
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


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = good_usda(tmp_path_factory.mktemp("good") / "clip_gaussians.usda")
    assert check_file(path, is_trusted=True) == ()
    return path


@pytest.mark.parametrize("mistake", EDITS)
def test_a_broken_cache_is_caught_in_its_place(mistake: str, good: Path, tmp_path: Path) -> None:
    edit, expected = EDITS[mistake]
    said = said_of(good, edit, tmp_path / good.name)
    assert any(line.startswith(expected) for line in said), said


def test_half_arrays_count_where_there_are_no_floats(good: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip_gaussians.usda"
    path.write_bytes(good.read_bytes())
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
    path.write_bytes(good.read_bytes())
    inner = Usd.Stage.Open(str(path))
    attribute(SPLATS, "scales", np.log)(inner)
    inner.Save()
    outer = Usd.Stage.CreateNew(str(tmp_path / "outer.usda"))
    prim = UsdGeom.Xform.Define(outer, "/Lamp").GetPrim()
    prim.GetPayloads().AddPayload("./clip_gaussians.usda")
    outer.Save()
    said = [str(problem) for problem in check_file(tmp_path / "outer.usda", is_trusted=True)]
    assert any(line.startswith("/Lamp/Splats.scales") for line in said), said
