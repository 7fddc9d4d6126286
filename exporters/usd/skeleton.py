"""The rig as a UsdSkel Skeleton, and its tracks as a SkelAnimation."""

import logging

import numpy as np
from pxr import Usd, UsdSkel

from exporters import keyframes, posing
from exporters.clip import Clip
from exporters.key_reduction import find_kept_keys, with_keys
from exporters.options import ExportOptions
from exporters.usd import names, values
from exporters.usd.uncertainty import add_uncertainty

PORTABLE_JOINT_COUNT = 254
"""What every tool takes: Unreal and Spark index 256 joints by default, Scene Viewer takes 254."""

_log = logging.getLogger(__name__)


def define_skeleton(
    stage: Usd.Stage, clip: Clip, path: str, options: ExportOptions
) -> UsdSkel.Skeleton:
    """Define a Skeleton at `path` and the SkelAnimation that drives it below.

    `restTransforms` are joint-local, `bindTransforms` in world space. `scales` are authored though
    all are one: without them Blender drops the animation without a word. A time sample holds all
    joints, so with a tolerance only keys that no joint needs are left out. What is known of the
    joints' uncertainty is beside the motion, see `exporters.usd.uncertainty`.

    Returns:
        The skeleton, bound to its animation.
    """
    rig = clip.rig
    if len(rig) > PORTABLE_JOINT_COUNT:
        _log.warning(
            "%s: %d joints; some tools (Unreal by default, Scene Viewer) take %d at most",
            clip.name,
            len(rig),
            PORTABLE_JOINT_COUNT,
        )
    joints = values.tokens(names.joint_paths(rig.joint_names, rig.parents.tolist()))
    skeleton = UsdSkel.Skeleton.Define(stage, path)
    skeleton.CreateJointsAttr(joints)
    skeleton.CreateJointNamesAttr(values.tokens(rig.joint_names))
    skeleton.CreateBindTransformsAttr(values.matrices(clip.bind_matrices()))
    rest_matrices = posing.local_matrices(rig.rest_translations, rig.rest_quats_wxyz)
    skeleton.CreateRestTransformsAttr(values.matrices(rest_matrices))

    animation = UsdSkel.Animation.Define(stage, f"{path}/Anim")
    animation.CreateJointsAttr(joints)
    animation.CreateScalesAttr(values.half_vectors(np.ones((len(rig), 3))))
    translations = animation.CreateTranslationsAttr()
    rotations = animation.CreateRotationsAttr()
    kept = find_kept_keys(clip, options, shared=True)[:, 0]
    tracks = with_keys(clip.tracks, kept)
    codes = keyframes.key_codes(clip)[kept]
    for key, code in enumerate(codes):
        translations.Set(values.vectors(tracks.translations[key]), float(code))
        rotations.Set(values.quats(tracks.quats_wxyz[key]), float(code))
    if clip.uncertainty is not None:
        add_uncertainty(animation.GetPrim(), clip.uncertainty, np.flatnonzero(kept), codes)

    binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    return skeleton
