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
exporter does.
"""

import dataclasses

import numpy as np

from exporters import harmonics, quaternions
from exporters.clip import Clip, ClipCamera

Y_UP_FROM_Z_UP_WXYZ = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])
Y_UP_FROM_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def to_y_up_meters(clip: Clip) -> Clip:
    """Return the same asset with +y up and one unit a meter; a clip that is so already, itself.

    The root joint, the Gaussians (their spherical harmonics too) and the camera turn; all lengths
    scale.
    """
    if clip.up_axis == "Z":
        clip = _turned(clip)
    if clip.meters_per_unit != 1.0:
        clip = _scaled(clip, clip.meters_per_unit)
    return clip


def _turned(clip: Clip) -> Clip:
    """Turn the world from Z-up to Y-up."""
    splats, rig, tracks = clip.splats, clip.rig, clip.tracks
    rest_translations, rest_quats_wxyz = rig.rest_translations.copy(), rig.rest_quats_wxyz.copy()
    rest_translations[0] = Y_UP_FROM_Z_UP @ rest_translations[0]
    rest_quats_wxyz[0] = quaternions.multiply(Y_UP_FROM_Z_UP_WXYZ, rest_quats_wxyz[0])
    translations, quats_wxyz = tracks.translations.copy(), tracks.quats_wxyz.copy()
    translations[:, 0] = translations[:, 0] @ Y_UP_FROM_Z_UP.T
    quats_wxyz[:, 0] = quaternions.multiply(Y_UP_FROM_Z_UP_WXYZ, quats_wxyz[:, 0])
    camera = clip.camera
    if camera is not None:
        y_up_from_z_up = np.eye(4)
        y_up_from_z_up[:3, :3] = Y_UP_FROM_Z_UP
        camera = dataclasses.replace(
            camera, cam_from_world=camera.cam_from_world @ y_up_from_z_up.T
        )
    return dataclasses.replace(
        clip,
        splats=dataclasses.replace(
            splats,
            positions=splats.positions @ Y_UP_FROM_Z_UP.T.astype(np.float32),
            quats_wxyz=quaternions.multiply(Y_UP_FROM_Z_UP_WXYZ, splats.quats_wxyz),
            sh_coeffs=harmonics.rotate(splats.sh_coeffs, Y_UP_FROM_Z_UP),
        ),
        rig=dataclasses.replace(
            rig, rest_translations=rest_translations, rest_quats_wxyz=rest_quats_wxyz
        ),
        tracks=dataclasses.replace(tracks, translations=translations, quats_wxyz=quats_wxyz),
        camera=camera,
        up_axis="Y",
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
        meters_per_unit=1.0,
    )


def _scaled_camera(camera: ClipCamera, factor: float) -> ClipCamera:
    """Move a camera with its world: only its distance to the origin changes."""
    cam_from_world = camera.cam_from_world.copy()
    cam_from_world[:, :3, 3] *= factor
    return dataclasses.replace(camera, cam_from_world=cam_from_world)
