"""Bake solved anchors into a clip: one joint an anchor under one still root (the only torch-to-exporters seam).

Joint k binds at Trans(a_k) and moves as Trans(a_k + T_k) R_k. Then linear blend skinning by
world x inverse bind = Trans(a_k + T_k) R_k Trans(-a_k) equals Eq. 2 exactly.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch

from animator.types import (
    AnchorPoses,
    Anchors,
    AnchorUncertainty,
    Camera,
    Gaussians,
    RigidGroups,
)
from exporters.clip import Clip, ClipCamera, Rig, Skin, Splats, Tracks, Uncertainty
from exporters.keyframes import continue_signs


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Key:
    """One key of the clip."""

    time_s: float
    """When [s]."""
    source_frame: int
    """Number of the frame it was solved from, -1 for an in-between."""
    poses: AnchorPoses
    """The pose."""
    camera: Camera
    """The camera at that moment."""
    uncertainty: AnchorUncertainty | None = None
    """How well the anchors were observed then, None if it was not estimated."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClipLabels:
    """What a clip says about itself."""

    name: str
    fps: float
    up_axis: str = "Y"
    meters_per_unit: float = 1.0


def bake_clip(
    gaussians: Gaussians,
    anchors: Anchors,
    anchor_groups: RigidGroups,
    keys: Sequence[Key],
    labels: ClipLabels,
) -> Clip:
    """Turn the solved keys into a clip.

    Args:
        gaussians: The rest pose.
        anchors: The rig.
        anchor_groups: Rigid group of each anchor.
        keys: At least one, in time order, the first at 0 s.
        labels: Name, rate and axes.

    Returns:
        A validated clip.

    Raises:
        exporters.errors.ClipError: If the result is not a valid clip (our own bug).
    """
    rest = _array(anchors.positions)
    count = len(rest)
    identity = np.array([1.0, 0.0, 0.0, 0.0])
    translations = np.zeros((len(keys), count + 1, 3))
    quats_wxyz = np.tile(identity, (len(keys), count + 1, 1))
    for index, key in enumerate(keys):
        translations[index, 1:] = rest + _array(key.poses.translations)
        quats_wxyz[index, 1:] = _array(key.poses.quats_wxyz)
    quats_wxyz /= np.linalg.norm(quats_wxyz, axis=-1, keepdims=True)
    weights = _array(anchors.skin_weights)
    clip = Clip(
        name=labels.name,
        splats=Splats(
            positions=_array(gaussians.means),
            quats_wxyz=_array(gaussians.quats_wxyz),
            scales=_array(gaussians.scales),
            opacities=_array(gaussians.opacities),
            sh_coeffs=_array(gaussians.sh_coeffs),
        ),
        rig=Rig(
            joint_names=("root", *(f"anchor_{k:03d}" for k in range(count))),
            parents=np.array([-1] + [0] * count),
            rest_translations=np.concatenate([np.zeros((1, 3)), rest]),
            rest_quats_wxyz=np.tile(identity, (count + 1, 1)),
            part_ids=np.concatenate([[-1], anchor_groups.labels]),
        ),
        skin=Skin(
            joint_ids=np.where(weights > 0, _array(anchors.skin_ids) + 1, 0), weights=weights
        ),
        tracks=Tracks(
            times_s=np.array([key.time_s for key in keys]),
            translations=translations,
            quats_wxyz=continue_signs(quats_wxyz),
        ),
        camera=_bake_camera([key.camera for key in keys]),
        fps=labels.fps,
        up_axis="Z" if labels.up_axis == "Z" else "Y",
        meters_per_unit=labels.meters_per_unit,
        source_frames=tuple(key.source_frame for key in keys),
        uncertainty=_bake_uncertainty([key.uncertainty for key in keys]),
    )
    clip.validate()
    return clip


def _array(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().cpu().numpy()


def _bake_camera(cameras: Sequence[Camera]) -> ClipCamera:
    """Keep one pose if the camera stands still."""
    poses = np.stack([camera.cam_from_world for camera in cameras])
    if np.allclose(poses, poses[:1], atol=1e-9):
        poses = poses[:1]
    first = cameras[0]
    return ClipCamera(
        cam_from_world=poses,
        intrinsics=first.intrinsics,
        width_px=first.width_px,
        height_px=first.height_px,
    )


def _bake_uncertainty(of_keys: Sequence[AnchorUncertainty | None]) -> Uncertainty | None:
    """Return what was estimated at all keys, None unless it was; the root stands still."""
    known = [uncertainty for uncertainty in of_keys if uncertainty is not None]
    if len(known) < len(of_keys):
        return None
    return Uncertainty(
        along_ray=np.stack([np.append(np.float32(0), known_at.along_ray) for known_at in known]),
        across_ray=np.stack([np.append(np.float32(0), known_at.across_ray) for known_at in known]),
    )
