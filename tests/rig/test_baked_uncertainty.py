"""The uncertainty of frames becomes that of keys."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from animator.deform.anchors import build_anchors
from animator.pipeline import FitConfig, _keys
from animator.rig.bake import ClipLabels, bake_clip
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.types import AnchorPoses, AnchorUncertainty, RigidGroups
from tests.helpers.objects import box_points, front_camera, gaussians_at


@pytest.fixture(scope="module")
def bar():
    gaussians = gaussians_at(box_points((0, 0, 0), (2.0, 0.4, 0.4), 300, 0))
    return gaussians, build_anchors(gaussians, target_count=8)


def baked(bar, known: list[AnchorUncertainty | None]):
    gaussians, anchors = bar
    stats = FrameStats(matches=0, reprojection_px=0.0, start="rest", groups=0, seconds={})
    rest = SolvedFrame(
        poses=AnchorPoses.identity(anchors),
        camera=front_camera(),
        groups=RigidGroups(labels=np.full(len(gaussians), -1)),
        stats=stats,
    )
    solved = [dataclasses.replace(rest, uncertainty=uncertainty) for uncertainty in known]
    scene = SimpleNamespace(frames=SimpleNamespace(numbers=tuple(range(len(known)))))
    nowhere = RigidGroups(labels=np.full(len(anchors), -1))
    keys = _keys(solved, scene, anchors, nowhere, 24.0, FitConfig(inbetween=1))
    return bake_clip(gaussians, anchors, nowhere, keys, ClipLabels(name="bar", fps=24.0))


def figures(seed: int, count: int) -> AnchorUncertainty:
    rng = np.random.default_rng(seed)
    return AnchorUncertainty(
        along_ray=rng.random(count, np.float32), across_ray=rng.random(count, np.float32)
    )


def test_keys_have_the_figures_of_their_frames_and_in_betweens_the_larger_of_two(bar):
    known = [figures(seed, len(bar[1])) for seed in range(3)]
    clip = baked(bar, known)
    for field in ("along_ray", "across_ray"):
        rows = getattr(clip.uncertainty, field)
        assert rows.shape == (5, len(bar[1]) + 1)
        assert not rows[:, 0].any()  # the root stands still
        first, second, third = (getattr(frame, field) for frame in known)
        expected = [first, np.maximum(first, second), second, np.maximum(second, third), third]
        np.testing.assert_array_equal(rows[:, 1:], expected)


def test_one_frame_without_figures_leaves_the_clip_without(bar):
    assert baked(bar, [figures(0, len(bar[1])), None]).uncertainty is None
