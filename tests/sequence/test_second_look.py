"""Limbs that lean the wrong way are turned over, in one frame and then in its neighbors."""

import dataclasses
import types

import numpy as np
import pytest
import torch

from animator.deform.anchors import build_anchors
from animator.deform.depth_flips import flipped_poses
from animator.deform.limbs import find_limbs
from animator.sequence.bare_solver import BareSolver
from animator.sequence.second_look import SecondLookConfig, looked_at_again
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.types import AnchorPoses, RigidGroups
from tests.helpers.objects import box_points, front_camera, gaussians_at

CAMERA = front_camera(6.0)
CONFIG = SecondLookConfig()
STATS = FrameStats(matches=0, reprojection_px=0.0, start="previous", groups=0, seconds={})


class Judge:
    """A driver, and its image solver, for which a pose costs the more the farther it is from the truth.

    Solving goes to the truth from near it, and stays where it is from elsewhere.
    """

    def __init__(self, shown: list[bool]) -> None:
        """Build a body with a leaning arm.

        Args:
            shown: For each frame, whether the arm leans the other way than at rest.
        """
        body = box_points((0, 0, 0), (0.8, 1.6, 0.8), 1500, 0)
        arm = box_points((0.9, 0, 0.0), (1.0, 0.2, 0.2), 400, 1)
        arm[:, 2] += 0.8 * (arm[:, 0] - 0.4)
        gaussians = gaussians_at(np.concatenate([body, arm]))
        anchors = build_anchors(gaussians, target_count=60)
        frames = types.SimpleNamespace(numbers=tuple(range(len(shown))))
        self.problem = types.SimpleNamespace(anchors=anchors, gaussians=gaussians, frames=frames)
        self.rest = AnchorPoses.identity(anchors)
        end = int(anchors.positions[:, 0].argmax())
        limbs = find_limbs(anchors, CONFIG.flips.lengths)
        flips = flipped_poses(anchors, self.rest, CAMERA, limbs, CONFIG.flips)
        self.flipped = [poses for limb, poses in flips if limb.tip == end][-1]
        self.truths = [self.flipped if is_flipped else self.rest for is_flipped in shown]
        self.solved_frames: list[int] = []
        self.bare_solver = BareSolver(self)

    def target_of(self, index: int, frame: SolvedFrame) -> int:
        return index

    def energy(self, poses: AnchorPoses, target: int, previous: AnchorPoses) -> float:
        return 1.0 + self._distance(target, poses)

    def solve(
        self, target: int, start: AnchorPoses, previous: AnchorPoses, *, most_steps: int | None
    ) -> AnchorPoses:
        self.solved_frames.append(target)
        return self.truths[target] if self._distance(target, start) < 0.02 else start

    def _distance(self, index: int, poses: AnchorPoses) -> float:
        return float((poses.translations - self.truths[index].translations).norm(dim=1).mean())

    def at_rest(self) -> list[SolvedFrame]:
        frame = SolvedFrame(
            poses=self.rest,
            camera=CAMERA,
            groups=RigidGroups(labels=np.zeros(0, np.int64)),
            stats=STATS,
        )
        return [frame] * len(self.truths)


def is_flipped(judge: Judge, frames: list[SolvedFrame]) -> list[bool]:
    far = [
        (frame.poses.translations - judge.rest.translations).norm(dim=1).max() for frame in frames
    ]
    return [float(distance) > 0.1 for distance in far]


@pytest.mark.parametrize("count", [2, 6, 9])
def test_a_flip_spreads_as_far_as_it_helps(count):
    shown = [False, *[True] * (count - 1)]
    judge = Judge(shown)
    frames = looked_at_again(judge.at_rest(), judge, CONFIG)
    assert is_flipped(judge, frames) == shown
    assert frames[-1].stats.start == "flipped limb"


def test_a_flip_found_in_the_middle_spreads_both_ways_and_ends():
    shown = [False] * 3 + [True] * 7 + [False] * 4
    judge = Judge(shown)
    frames = looked_at_again(judge.at_rest(), judge, CONFIG)
    assert is_flipped(judge, frames) == shown


def test_what_is_right_stays_as_it_is():
    judge = Judge([False] * 12)
    before = judge.at_rest()
    for frame, kept in zip(looked_at_again(before, judge, CONFIG), before, strict=True):
        assert torch.equal(frame.poses.translations, kept.poses.translations)
        assert frame.stats == kept.stats


def test_held_frames_follow_and_are_not_solved():
    judge = Judge([False, True, True, True])
    frames = judge.at_rest()
    frames[2] = dataclasses.replace(frames[2], stats=dataclasses.replace(STATS, start="held"))
    frames = looked_at_again(frames, judge, CONFIG)
    assert is_flipped(judge, frames) == [False, True, True, True]
    assert 2 not in judge.solved_frames


def test_switched_off_nothing_is_solved():
    judge = Judge([False, True])
    off = SecondLookConfig(every=0)
    assert is_flipped(judge, looked_at_again(judge.at_rest(), judge, off)) == [False, False]
    assert not judge.solved_frames
