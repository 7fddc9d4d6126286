from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import torch

from animator.sequence.start_stage import StartStage, StartStageConfig
from animator.sequence.stopwatch import Stopwatch
from animator.types import AnchorPoses

TARGET: Any = None


def shifted(by: float) -> AnchorPoses:
    return AnchorPoses(
        quats_wxyz=torch.tensor([[1.0, 0.0, 0.0, 0.0]]), translations=torch.tensor([[by, 0.0, 0.0]])
    )


class World:
    """A point on a line: what its picture says of a place, and what descent from there comes to."""

    def __init__(
        self,
        errors: dict[float, float],
        energies: dict[float, float],
        diagonal: float = 50.0,
        steps: int = 24,
    ):
        self.errors, self.energies, self.asked = errors, energies, []
        parts = {
            "image_solver": SimpleNamespace(
                image_error=lambda poses, _: self.at(errors, poses),
                gaussians=SimpleNamespace(diagonal=diagonal),
            ),
            "match_stage": SimpleNamespace(
                solve=lambda *_: SimpleNamespace(poses=shifted(5.0), matches=None)
            ),
            "claim_stage": SimpleNamespace(solve=lambda *_: None),
            "sketcher": SimpleNamespace(sketch=lambda _: self),
        }
        self.stage = StartStage(**cast(Any, parts), config=StartStageConfig(race_steps=steps))

    @staticmethod
    def at(table: dict[float, float], poses: AnchorPoses) -> float:
        return table[round(float(poses.translations[0, 0]), 3)]

    def solve(self, start: AnchorPoses, steps: int) -> AnchorPoses:
        self.asked.append(steps)
        return start

    def energy(self, poses: AnchorPoses) -> float:
        return self.at(self.energies, poses)

    def start(self, before: AnchorPoses | None) -> str:
        """Which start is chosen for a point that went from 0 to 1, may go on to 2, and is matched at 5."""
        expected = self.stage.expect(TARGET, shifted(1.0), before)
        rng = np.random.default_rng(0)
        return self.stage.follow_matches(expected, cast(Any, None), TARGET, rng, Stopwatch()).name


LOOKS_BEST_AT_5 = {1.0: 0.3, 2.0: 0.4, 5.0: 0.2}


@pytest.mark.parametrize(
    ("onward", "name"), [(0.9, "extrapolated"), (0.96, "matches"), (1.1, "matches")]
)
def test_motion_that_goes_on_is_started_from_where_it_clearly_wins_a_race(onward, name):
    world = World(LOOKS_BEST_AT_5, {2.0: onward, 5.0: 1.0})
    assert world.start(shifted(0.0)) == name
    assert world.asked == [24, 24]


def test_no_race_where_motion_is_not_expected_to_go_on_or_starts_are_near_or_one():
    world = World(LOOKS_BEST_AT_5, {2.0: 0.1, 5.0: 1.0})
    assert world.start(None) == "matches"
    for off in ({"steps": 0}, {"diagonal": 150.0}):
        assert World(LOOKS_BEST_AT_5, {2.0: 0.1, 5.0: 1.0}, **off).start(shifted(0.0)) == "matches"
    chosen = World({1.0: 0.3, 2.0: 0.1, 5.0: 0.2}, {})
    assert chosen.start(shifted(0.0)) == "extrapolated"
    assert world.asked == chosen.asked == []
