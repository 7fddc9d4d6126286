"""The nets hold: each mistake of the two lists of mutants is caught, where it is made."""

import json
from pathlib import Path

import numpy as np
import pytest

from exporters.clip import Clip
from tests.golden.cases import CLIPS, FORMATS, golden_path
from tests.golden.compare import differences
from tests.golden.conversion_mutants import CONVERSION_MUTANTS
from tests.golden.mutants import CLIP_MUTANTS
from tests.helpers import playback

CASE = "random"
"""The golden clip in which nothing is symmetric, so that no mistake hides."""

PLAYERS = {
    "gltf": ("clip.glb", playback.gltf_centers),
    "usd": ("clip.usdc", playback.usd_centers),
}


def golden_differences(clip: Clip, case: str, form: str, folder: Path) -> list[str]:
    """Export a clip that may be wrong and compare it with the golden file of the right one."""
    found = FORMATS[form](clip, folder)
    return differences(json.loads(golden_path(case, form).read_text(encoding="utf-8")), found)


def played_error(case: str, form: str, folder: Path) -> float:
    """Return the largest error of the exported file against the true clip, over its diagonal."""
    truth = CLIPS[case]()
    file_name, centers = PLAYERS[form]
    keys = truth.tracks.times_s
    errors = [
        np.abs(centers(folder / file_name, time_s) - playback.clip_centers(truth, time_s)).max()
        for time_s in [*keys, *((keys[1:] + keys[:-1]) / 2)]
    ]
    diagonal = np.linalg.norm(np.ptp(playback.clip_centers(truth, 0.0), axis=0))
    return float(max(errors) / diagonal)


@pytest.mark.parametrize(
    ("mistake", "form"),
    [(mistake, form) for mistake, mutant in CLIP_MUTANTS.items() for form in mutant.shows_at],
)
def test_a_wrong_clip_is_caught(
    mistake: str, form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mutant = CLIP_MUTANTS[mistake]
    # Validation would stop some of them; here the golden files have to.
    monkeypatch.setattr(Clip, "validate", lambda self: None)
    with np.errstate(invalid="ignore"):
        lines = golden_differences(mutant.breaks(CLIPS[CASE](), form), CASE, form, tmp_path)
    assert any(mutant.shows_at[form] in line for line in lines)
    if form in PLAYERS:
        assert (played_error(CASE, form, tmp_path) > 1e-5) == mutant.moves


@pytest.mark.parametrize("mistake", CONVERSION_MUTANTS)
def test_a_wrong_conversion_is_caught(
    mistake: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mutant = CONVERSION_MUTANTS[mistake]
    mutant.patches(monkeypatch)
    clip = CLIPS[mutant.case]()
    lines = golden_differences(clip, mutant.case, mutant.form, tmp_path)
    assert any(mutant.shows_at in line for line in lines)
    if mutant.form in PLAYERS:
        assert played_error(mutant.case, mutant.form, tmp_path) > 1e-5


@pytest.mark.parametrize("form", PLAYERS)
def test_the_right_clip_is_not_caught(form: str, tmp_path: Path) -> None:
    assert golden_differences(CLIPS[CASE](), CASE, form, tmp_path) == []
    assert played_error(CASE, form, tmp_path) <= 1e-5
