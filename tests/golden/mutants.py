"""Clips as a mistaken exporter would understand them, to prove that the golden files show it."""

import dataclasses
from collections.abc import Callable

import numpy as np

from exporters.clip import Clip


@dataclasses.dataclass(frozen=True, kw_only=True)
class Mutant:
    """One mistake, and where each format shows it."""

    breaks: Callable[[Clip, str], Clip]
    """Returns what the mistaken exporter would have written, given the clip and the format."""
    shows_at: dict[str, str]
    """By format: part of the path of at least one difference. Formats not here cannot show it."""
    moves: bool = True
    """Whether the carrier moves otherwise, so that playing the file shows it too."""


def swap_w_and_x(clip: Clip, form: str) -> Clip:
    swapped = [1, 0, 2, 3]
    return dataclasses.replace(
        clip,
        tracks=dataclasses.replace(clip.tracks, quats_wxyz=clip.tracks.quats_wxyz[..., swapped]),
        splats=dataclasses.replace(clip.splats, quats_wxyz=clip.splats.quats_wxyz[:, swapped]),
    )


def drop_middle_key(clip: Clip, form: str) -> Clip:
    kept = np.delete(np.arange(len(clip.tracks)), 1)
    tracks = clip.tracks
    camera = clip.camera
    assert camera is not None
    return dataclasses.replace(
        clip,
        tracks=dataclasses.replace(
            tracks,
            times_s=tracks.times_s[kept],
            translations=tracks.translations[kept],
            quats_wxyz=tracks.quats_wxyz[kept],
        ),
        camera=dataclasses.replace(camera, cam_from_world=camera.cam_from_world[kept]),
        source_frames=tuple(clip.source_frames[i] for i in kept),
    )


def shift_later_keys_a_frame(clip: Clip, form: str) -> Clip:
    times_s = np.concatenate([[0.0], clip.tracks.times_s[1:] + 1 / clip.fps])
    return dataclasses.replace(clip, tracks=dataclasses.replace(clip.tracks, times_s=times_s))


def transpose_rotations(clip: Clip, form: str) -> Clip:
    inverse = clip.tracks.quats_wxyz * [1.0, -1.0, -1.0, -1.0]
    return dataclasses.replace(clip, tracks=dataclasses.replace(clip.tracks, quats_wxyz=inverse))


def scale_a_hundredfold(clip: Clip, form: str) -> Clip:
    splats, rig, tracks = clip.splats, clip.rig, clip.tracks
    return dataclasses.replace(
        clip,
        splats=dataclasses.replace(
            splats, positions=splats.positions * 100, scales=splats.scales * 100
        ),
        rig=dataclasses.replace(rig, rest_translations=rig.rest_translations * 100),
        tracks=dataclasses.replace(tracks, translations=tracks.translations * 100),
    )


def swap_two_joints(clip: Clip, form: str) -> Clip:
    order = np.arange(len(clip.rig))
    order[[1, 2]] = [2, 1]
    return dataclasses.replace(
        clip, skin=dataclasses.replace(clip.skin, joint_ids=order[clip.skin.joint_ids])
    )


def confuse_log_and_linear_scales(clip: Clip, form: str) -> Clip:
    """PLY stores logarithms: forgetting them leaves the scales, that is log(exp(s))."""
    wrong = np.exp if form == "ply" else np.log
    splats = dataclasses.replace(clip.splats, scales=wrong(clip.splats.scales))
    return dataclasses.replace(clip, splats=splats)


def confuse_logit_and_opacity(clip: Clip, form: str) -> Clip:
    """PLY stores logits: forgetting them leaves the opacities, that is logit(sigmoid(a))."""
    opacities = clip.splats.opacities
    wrong = 1 / (1 + np.exp(-opacities)) if form == "ply" else np.log(opacities / (1 - opacities))
    return dataclasses.replace(clip, splats=dataclasses.replace(clip.splats, opacities=wrong))


def swap_two_harmonics(clip: Clip, form: str) -> Clip:
    sh_coeffs = clip.splats.sh_coeffs.copy()
    sh_coeffs[:, [1, 2]] = sh_coeffs[:, [2, 1]]
    return dataclasses.replace(clip, splats=dataclasses.replace(clip.splats, sh_coeffs=sh_coeffs))


def invert_the_camera(clip: Clip, form: str) -> Clip:
    camera = clip.camera
    assert camera is not None
    inverse = np.linalg.inv(camera.cam_from_world)
    return dataclasses.replace(clip, camera=dataclasses.replace(camera, cam_from_world=inverse))


def flip_a_sign(clip: Clip, form: str) -> Clip:
    """The same rotations, but tools that interpolate numbers would turn the long way."""
    quats_wxyz = clip.tracks.quats_wxyz.copy()
    quats_wxyz[1] *= -1
    return dataclasses.replace(clip, tracks=dataclasses.replace(clip.tracks, quats_wxyz=quats_wxyz))


CLIP_MUTANTS = {
    "swap w and x": Mutant(
        breaks=swap_w_and_x,
        shows_at={
            "gltf": ".rotation/values",
            "usd": "/rotations/samples",
            "cache": "/orientations/samples",
            "ply": "/rows",
            "gltf_parts": "/part",
            "usd_sibling": "/orientations/samples",
        },
    ),
    "drop a key": Mutant(
        breaks=drop_middle_key,
        shows_at={
            "gltf": ".rotation/times_s",
            "usd": "/rotations/times",
            "cache": "/positions/samples",
            "ply": "/rows",
            "gltf_parts": "/part",
            "usd_sibling": "/Splats/attributes/positions/samples",
        },
    ),
    "shift a frame": Mutant(
        breaks=shift_later_keys_a_frame,
        shows_at={
            "gltf": ".rotation/times_s",
            "usd": "/rotations/times",
            "cache": "/positions/times",
            "ply": ".ply: unexpected",
            "gltf_parts": ".rotation/times_s",
            "usd_sibling": "/Splats/attributes/positions/times",
        },
    ),
    "transpose the rotations": Mutant(
        breaks=transpose_rotations,
        shows_at={
            "gltf": ".rotation/values",
            "usd": "/rotations/samples",
            "cache": "/orientations/samples",
            "ply": "/rows",
            "gltf_parts": "/part",
            "usd_sibling": "/orientations/samples",
        },
    ),
    "scale a hundredfold": Mutant(
        breaks=scale_a_hundredfold,
        shows_at={
            "gltf": "/POSITION/values",
            "usd": "/points/default",
            "cache": "/positions/samples",
            "ply": "/rows",
            "gltf_parts": "/POSITION/values",
            "usd_sibling": "/Splats/attributes/positions/samples",
        },
    ),
    "swap two joints": Mutant(
        breaks=swap_two_joints,
        shows_at={
            "gltf": "/JOINTS_0/values",
            "usd": "/primvars:skel:jointIndices/default",
            "cache": "/positions/samples",
            "ply": "/rows",
            "gltf_parts": "/part",
            "usd_sibling": "/Splats/attributes/positions/samples",
        },
    ),
    "confuse log and linear scales": Mutant(
        breaks=confuse_log_and_linear_scales,
        shows_at={
            "gltf": "/KHR_gaussian_splatting:SCALE/values",
            "usd": "/points/default",
            "cache": "/scales/default",
            "ply": "/rows",
            "gltf_parts": "/KHR_gaussian_splatting:SCALE/values",
            "usd_sibling": "/scales/default",
        },
        moves=False,
    ),
    "confuse logit and opacity": Mutant(
        breaks=confuse_logit_and_opacity,
        shows_at={
            "gltf": "/KHR_gaussian_splatting:OPACITY/values",
            "usd": "/primvars:displayOpacity/default",
            "cache": "/opacities/default",
            "ply": "/rows",
            "gltf_parts": "/KHR_gaussian_splatting:OPACITY/values",
            "usd_sibling": "/opacities/default",
        },
        moves=False,
    ),
    "swap two harmonics": Mutant(
        breaks=swap_two_harmonics,
        shows_at={
            "gltf": ":SH_DEGREE_1_COEF_0/values",
            "cache": "/radiance:sphericalHarmonicsCoefficients/default",
            "ply": "/rows",
            "gltf_parts": ":SH_DEGREE_1_COEF_0/values",
            "usd_sibling": "/radiance:sphericalHarmonicsCoefficients/default",
        },
        moves=False,
    ),
    "invert the camera": Mutant(
        breaks=invert_the_camera,
        shows_at={
            "gltf": "/nodes/camera/translation",
            "usd": "/Camera/attributes/xformOp",
            "gltf_parts": "/nodes/camera/translation",
            "usd_sibling": "/Camera/attributes/xformOp",
        },
        moves=False,
    ),
    "flip a sign": Mutant(
        breaks=flip_a_sign,
        shows_at={
            "gltf": ".rotation/sign_continuous",
            "usd": "/rotations/sign_continuous",
            "gltf_parts": ".rotation/sign_continuous",
            "usd_sibling": "/rotations/sign_continuous",
        },
        moves=False,
    ),
}
"""Mistakes in what is written: the clip itself is wrong."""
