import dataclasses

import numpy as np
import torch

from animator import quaternions
from animator.deform.anchors import build_anchors
from animator.deform.skinning import Skinner
from animator.rig.bake import ClipLabels, Key, bake_clip
from animator.types import AnchorPoses, RigidGroups
from tests.helpers.objects import box_points, front_camera, gaussians_at


def test_the_clip_moves_exactly_as_the_optimizer_saw_it():
    gaussians = gaussians_at(box_points((3, -2, 5), (2.0, 0.6, 0.5), 900, 0))
    anchors = build_anchors(gaussians, target_count=25)
    generator = torch.Generator().manual_seed(0)
    count = len(anchors)
    keys = [
        Key(time_s=0.0, source_frame=0, poses=AnchorPoses.identity(anchors), camera=front_camera())
    ]
    for k in range(1, 4):
        noise = 0.3 * torch.randn(count, 4, generator=generator)
        poses = AnchorPoses(
            quats_wxyz=quaternions.normalize(noise + torch.tensor([1.0, 0, 0, 0])) * (-1) ** k,
            translations=0.2 * torch.randn(count, 3, generator=generator),
        )
        keys.append(dataclasses.replace(keys[0], time_s=k / 24, source_frame=k, poses=poses))
    groups = RigidGroups(labels=np.arange(count) % 3 - 1)
    clip = bake_clip(gaussians, anchors, groups, keys, ClipLabels(name="bar", fps=24.0))

    assert len(clip.rig) == count + 1
    assert clip.camera is not None and clip.camera.cam_from_world.shape == (1, 4, 4)
    assert clip.rig.part_ids.tolist() == [-1, *groups.labels.tolist()]
    skinner = Skinner(anchors, gaussians.means, gaussians.quats_wxyz)
    for key in keys:
        means, quats = skinner(key.poses)
        posed = clip.pose_at(key.time_s)
        assert np.abs(posed.positions - means.numpy()).max() / gaussians.diagonal < 1e-6
        cosines = np.abs((posed.quats_wxyz * quats.numpy()).sum(axis=1))
        assert cosines.min() > 1 - 1e-6
