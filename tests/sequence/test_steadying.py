"""What nearly is one rigid body becomes one only if that explains the frames."""

import dataclasses
import types

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from animator.deform.anchors import build_anchors
from animator.sequence.rigid_body import RigidBodyConfig
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.sequence.steadying import SteadyingConfig, steadied
from animator.types import AnchorPoses, AnchorUncertainty, RigidGroups
from tests.helpers.moved_box import CAMERA, rigid
from tests.helpers.textured import textured_box

STATS = FrameStats(matches=0, reprojection_px=0.0, start="previous", groups=0, seconds={})


class Judge:
    """A driver that finds nothing better than the rigid pose, and has its losses given."""

    def __init__(self, losses: list[float], bent_loss: float = 0.0) -> None:
        gaussians = textured_box()
        anchors = build_anchors(gaussians, target_count=60)
        self.problem = types.SimpleNamespace(gaussians=gaussians, anchors=anchors)
        self._losses = losses
        self._bent_loss = bent_loss

    def refit_rigid(self, index: int, frame: SolvedFrame) -> AnchorPoses:
        return frame.poses

    def image_loss(self, index: int, frame: SolvedFrame) -> float:
        is_bent = self.largest_strain([frame]) > 1e-5 * self.problem.gaussians.diagonal
        return self._bent_loss if is_bent else self._losses[index]

    def seen_shares(self, frame: SolvedFrame) -> np.ndarray:
        return np.ones(len(self.problem.anchors))

    def shivering_box(self) -> list[SolvedFrame]:
        """A turning box, a little bent in every frame but the first."""
        anchors, diagonal = self.problem.anchors, self.problem.gaussians.diagonal
        rng = np.random.default_rng(0)
        frames = []
        for index in range(5):
            pose = rigid(anchors, Rotation.from_euler("y", 4 * index, degrees=True), [0.0] * 3)
            bend = rng.normal(0.0, 1e-3 * diagonal * bool(index), pose.translations.shape)
            frames.append(
                SolvedFrame(
                    poses=AnchorPoses(
                        quats_wxyz=pose.quats_wxyz,
                        translations=pose.translations + torch.as_tensor(bend).float(),
                    ),
                    camera=CAMERA,
                    groups=RigidGroups(labels=np.zeros(0, np.int64)),
                    stats=STATS,
                )
            )
        return frames

    def largest_strain(self, frames: list[SolvedFrame]) -> float:
        rest = torch.pdist(self.problem.anchors.positions)
        return max(
            float(
                (torch.pdist(self.problem.anchors.positions + frame.poses.translations) - rest)
                .abs()
                .max()
            )
            for frame in frames
        )


@pytest.mark.parametrize(
    ("losses", "is_rigid"),
    [([0.1, 0.11, 0.1, 0.115, 0.11], True), ([0.1, 0.1, 0.14, 0.1, 0.1], False)],
)
def test_one_frame_that_it_does_not_explain_keeps_the_bends(losses, is_rigid):
    judge = Judge(losses)
    steady = steadied(judge.shivering_box(), judge, SteadyingConfig())
    assert (judge.largest_strain(steady) < 1e-5 * judge.problem.gaussians.diagonal) == is_rigid


def test_a_rigid_body_that_is_drawn_no_worse_than_a_bending_one_is_rigid():
    judge = Judge([1e-3, 0.1, 0.1, 0.1, 0.1], bent_loss=0.1)
    steady = steadied(judge.shivering_box(), judge, SteadyingConfig())
    assert judge.largest_strain(steady) < 1e-5 * judge.problem.gaussians.diagonal


class Seer(Judge):
    """A driver of frames that show the first half of the anchors, and each of them where it was found."""

    def __init__(self, tracks: list[SolvedFrame]) -> None:
        super().__init__([])
        self._tracks = tracks
        self._seen = np.arange(len(self.problem.anchors)) < len(self.problem.anchors) // 2

    def image_loss(self, index: int, frame: SolvedFrame) -> float:
        moved = frame.poses.translations - self._tracks[index].poses.translations
        return 1e-3 + float(moved[self._seen].norm(dim=1).mean())

    def seen_shares(self, frame: SolvedFrame) -> np.ndarray:
        return self._seen.astype(np.float64)


def test_smoothing_does_not_spoil_what_is_seen():
    judge = Judge([])
    frames = judge.shivering_box()
    for index in (2, 3):  # a short, fast move to the side that no match held
        shift = torch.tensor([0.02 * judge.problem.gaussians.diagonal, 0.0, 0.0])
        poses = frames[index].poses
        moved = AnchorPoses(quats_wxyz=poses.quats_wxyz, translations=poses.translations + shift)
        frames[index] = dataclasses.replace(frames[index], poses=moved)
    count = len(judge.problem.anchors)
    unsure = AnchorUncertainty(
        along_ray=np.full(count, 1e3, np.float32), across_ray=np.full(count, 1e3, np.float32)
    )
    frames = [dataclasses.replace(frame, uncertainty=unsure) for frame in frames]
    config = SteadyingConfig(rigid_body=RigidBodyConfig(residual=0.0))

    def lost(config: SteadyingConfig) -> tuple[float, float]:
        """How far the picture and what is hidden in frame 2 were moved."""
        steady = steadied(frames, Seer(frames), config)[2].poses.translations
        moved = (steady - frames[2].poses.translations).norm(dim=1)
        return float(moved[: count // 2].mean()), float(moved[count // 2 :].mean())

    seen, hidden = lost(config)
    seen_before, hidden_before = lost(dataclasses.replace(config, rounds=0))
    assert seen < 0.5 * seen_before
    assert hidden == pytest.approx(hidden_before)
