"""Changes of the world's axes and unit, baked into a clip.

| who            | up       | handedness | unit             | camera looks along | camera up |
|----------------|----------|------------|------------------|--------------------|-----------|
| `Clip`         | its own  | right      | `meters_per_unit`| +z (OpenCV)        | -y        |
| USD            | `upAxis` | right      | `metersPerUnit`  | -z                 | +y        |
| glTF           | +y       | right      | 1 m              | -z                 | +y        |
| Blender        | +z       | right      | 1 m              | -z                 | +y        |
| INRIA PLY      | -        | right      | -                | -                  | -         |

USD names its axis and unit in the file, so it takes a clip as it is. glTF has one convention;
`to_y_up_meters` converts to it. The change is baked into every number, not left to a root node:
viewers differ in whether a node's rotation turns spherical harmonics (KHR_gaussian_splatting).
The turn from Z-up is -90 degrees about +x: (x, y, z) becomes (x, z, -y), as Blender's own glTF
exporter does; the turn from Y-up is the opposite one, (x, -z, y).
"""

import dataclasses
from typing import Literal

import numpy as np

from exporters import harmonics, quaternions
from exporters.clip import Clip, ClipCamera, Uncertainty

UpAxis = Literal["Y", "Z"]

Y_UP_FROM_Z_UP_WXYZ = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])
Y_UP_FROM_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def to_y_up_meters(clip: Clip) -> Clip:
    """Return the same asset with +y up and one unit a meter; a clip that is so already, itself."""
    return in_world(clip, up_axis="Y", meters_per_unit=1.0)


def in_world(clip: Clip, *, up_axis: UpAxis, meters_per_unit: float) -> Clip:
    """Return the same asset in a world of another up axis and unit; if it is so already, itself.

    The root joint, the Gaussians (their spherical harmonics too) and the camera turn; all lengths
    scale.

    Args:
        clip: The clip.
        up_axis: Axis that is up afterwards.
        meters_per_unit: Meters in one unit afterwards.
    """
    if clip.up_axis != up_axis:
        clip = _turned(clip, up_axis)
    if clip.meters_per_unit != meters_per_unit:
        factor = clip.meters_per_unit / meters_per_unit
        clip = dataclasses.replace(_scaled(clip, factor), meters_per_unit=meters_per_unit)
    return clip


def _turned(clip: Clip, up_axis: UpAxis) -> Clip:
    """Turn the world so that the other axis is up."""
    quat_wxyz, rotation = Y_UP_FROM_Z_UP_WXYZ, Y_UP_FROM_Z_UP
    if up_axis == "Z":
        quat_wxyz, rotation = quat_wxyz * [1.0, -1.0, 1.0, 1.0], rotation.T
    splats, rig, tracks = clip.splats, clip.rig, clip.tracks
    rest_translations, rest_quats_wxyz = rig.rest_translations.copy(), rig.rest_quats_wxyz.copy()
    rest_translations[0] = rotation @ rest_translations[0]
    rest_quats_wxyz[0] = quaternions.multiply(quat_wxyz, rest_quats_wxyz[0])
    translations, quats_wxyz = tracks.translations.copy(), tracks.quats_wxyz.copy()
    translations[:, 0] = translations[:, 0] @ rotation.T
    quats_wxyz[:, 0] = quaternions.multiply(quat_wxyz, quats_wxyz[:, 0])
    camera = clip.camera
    if camera is not None:
        turned_from_clip = np.eye(4)
        turned_from_clip[:3, :3] = rotation
        camera = dataclasses.replace(
            camera, cam_from_world=camera.cam_from_world @ turned_from_clip.T
        )
    return dataclasses.replace(
        clip,
        splats=dataclasses.replace(
            splats,
            positions=splats.positions @ rotation.T.astype(np.float32),
            quats_wxyz=quaternions.multiply(quat_wxyz, splats.quats_wxyz),
            sh_coeffs=harmonics.rotate(splats.sh_coeffs, rotation),
        ),
        rig=dataclasses.replace(
            rig, rest_translations=rest_translations, rest_quats_wxyz=rest_quats_wxyz
        ),
        tracks=dataclasses.replace(tracks, translations=translations, quats_wxyz=quats_wxyz),
        camera=camera,
        up_axis=up_axis,
    )


def _scaled(clip: Clip, factor: float) -> Clip:
    """Multiply every length by a factor; angles, pixels and times stay."""
    splats, rig, tracks = clip.splats, clip.rig, clip.tracks
    return dataclasses.replace(
        clip,
        splats=dataclasses.replace(
            splats,
            positions=splats.positions * np.float64(factor),
            scales=splats.scales * np.float64(factor),
        ),
        rig=dataclasses.replace(rig, rest_translations=rig.rest_translations * factor),
        tracks=dataclasses.replace(tracks, translations=tracks.translations * factor),
        camera=None if clip.camera is None else _scaled_camera(clip.camera, factor),
        uncertainty=None if clip.uncertainty is None else _scaled_lengths(clip.uncertainty, factor),
    )


def _scaled_lengths(uncertainty: Uncertainty, factor: float) -> Uncertainty:
    return Uncertainty(
        along_ray=uncertainty.along_ray * factor, across_ray=uncertainty.across_ray * factor
    )


def _scaled_camera(camera: ClipCamera, factor: float) -> ClipCamera:
    """Move a camera with its world: only its distance to the origin changes."""
    cam_from_world = camera.cam_from_world.copy()
    cam_from_world[:, :3, 3] *= factor
    return dataclasses.replace(camera, cam_from_world=cam_from_world)
