import dataclasses

import numpy as np
import pytest

from animator.evaluation.motion import motion_of_clip
from animator.evaluation.scores import carried_points, point_tracks
from animator.evaluation.truth_scene import read_truth_scene
from animator.evaluation.uncertainty_check import score_uncertainty
from exporters.clip import Clip, Rig, Skin, Splats, Tracks, Uncertainty


def test_a_rig_that_knows_what_it_misses_has_rank_one(master_scene, renderer, box):
    """Gaussian i follows joint 1 by a share that rises with its x; joint 1 is wrong and says so."""
    scene = read_truth_scene(master_scene, renderer)
    share = (box.means[:, 0].numpy() + 0.7) / 1.4
    weights = np.stack([1 - share, share, 0 * share, 0 * share], axis=1)
    identity = np.array([1.0, 0, 0, 0])
    translations = np.zeros((2, 2, 3))
    translations[1] = scene.truth.points[3, 0] - scene.truth.points[0, 0]
    rays = np.array([0.0, 0.0, 0.2])  # straight away from the camera
    translations[1, 1] += rays
    tracks = Tracks(
        times_s=np.array([0.0, 1.0]),
        translations=np.stack(
            [translations[:, 0], translations[:, 1] - translations[:, 0]], axis=1
        ),
        quats_wxyz=np.tile(identity, (2, 2, 1)),
    )
    clip = Clip(
        name="box",
        splats=Splats(
            positions=box.means.numpy(),
            quats_wxyz=box.quats_wxyz.numpy(),
            scales=box.scales.numpy(),
            opacities=box.opacities.numpy(),
            sh_coeffs=box.sh_coeffs.numpy(),
        ),
        rig=Rig(
            joint_names=("root", "wrong"),
            parents=np.array([-1, 0]),
            rest_translations=np.zeros((2, 3)),
            rest_quats_wxyz=np.tile(identity, (2, 1)),
            part_ids=np.array([-1, -1]),
        ),
        skin=Skin(joint_ids=np.tile([0, 1, 0, 0], (len(box), 1)), weights=weights),
        tracks=tracks,
        source_frames=(0, 3),
        uncertainty=Uncertainty(
            along_ray=np.array([[0, 0], [0, 0.2]]), across_ray=np.array([[0, 0], [0, 0.0]])
        ),
    )
    motion = motion_of_clip(clip)
    carried = carried_points(motion, scene)
    scores = score_uncertainty(clip, carried, point_tracks(motion, carried, scene, (3,)))
    assert scores.depth == pytest.approx(1.0, abs=0.01)
    assert np.isnan(scores.lateral)  # it claims the same of all
    silent = dataclasses.replace(clip, uncertainty=None)
    unclaimed = score_uncertainty(silent, carried, point_tracks(motion, carried, scene, (3,)))
    assert np.isnan(unclaimed.depth)
