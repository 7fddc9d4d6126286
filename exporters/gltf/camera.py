"""The solved camera as a glTF perspective camera."""

import logging
import math

import numpy as np
import pygltflib

from exporters import keyframes, quaternions
from exporters.clip import Clip, ClipCamera
from exporters.gltf import order
from exporters.gltf.animation import NodeTracks

_LOGGER = logging.getLogger(__name__)

# OpenCV looks along +z with +y down, glTF along -z with +y up (glTF 2.0, section 3.10.1).
_CV_FROM_GLTF = np.diag([1.0, -1.0, -1.0])

_CENTERED_PX = 0.5  # an offset below half a pixel is not worth a warning
_NEAR_SHARE_OF_DIAGONAL = 1e-3


def add_camera(document: pygltflib.GLTF2, clip: Clip, camera: ClipCamera) -> NodeTracks:
    """Add the camera and its node, posed as at the first key.

    A glTF camera looks through the center of its image: a principal point elsewhere is lost, with a
    warning. The exact intrinsics are kept in the camera's `extras`.

    Args:
        document: Receives the camera and the node.
        clip: Y-up, in meters.
        camera: The camera of that clip.

    Returns:
        The motion of the node; constant for a static camera.
    """
    _warn_of_lost_offset(camera)
    translations, quats_wxyz = _gltf_poses(camera, key_count=len(clip.tracks))
    document.cameras.append(
        pygltflib.Camera(
            name="camera",
            type="perspective",
            perspective=_perspective(clip, camera),
            extras={
                "intrinsics_px": camera.intrinsics.tolist(),
                "width_px": camera.width_px,
                "height_px": camera.height_px,
            },
        )
    )
    document.nodes.append(
        pygltflib.Node(
            name="camera",
            camera=len(document.cameras) - 1,
            translation=translations[0].tolist(),
            rotation=order.xyzw(quats_wxyz[0]).tolist(),
        )
    )
    return NodeTracks(
        nodes=[len(document.nodes) - 1],
        translations=translations[:, None],
        quats_wxyz=quats_wxyz[:, None],
        rest_translations=translations[:1],
        rest_quats_wxyz=quats_wxyz[:1],
    )


def _gltf_poses(camera: ClipCamera, *, key_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return world translations (T, 3) and rotations wxyz (T, 4) of the node, signs continuous."""
    cam_from_world = np.broadcast_to(camera.cam_from_world, (key_count, 4, 4))
    world_from_cv = cam_from_world[:, :3, :3].swapaxes(1, 2)
    translations = -np.einsum("tij,tj->ti", world_from_cv, cam_from_world[:, :3, 3])
    quats_wxyz = quaternions.from_matrices(world_from_cv @ _CV_FROM_GLTF)
    return translations, keyframes.continue_signs(quats_wxyz)


def _perspective(clip: Clip, camera: ClipCamera) -> pygltflib.Perspective:
    """Return the field of view (glTF 2.0, section 3.10.3); pixels need not be square."""
    focal_x_px, focal_y_px = camera.intrinsics[0, 0], camera.intrinsics[1, 1]
    diagonal_m = float(np.linalg.norm(np.ptp(clip.splats.positions, axis=0)))
    return pygltflib.Perspective(
        yfov=2 * math.atan(camera.height_px / (2 * focal_y_px)),
        aspectRatio=float((camera.width_px / focal_x_px) / (camera.height_px / focal_y_px)),
        # Small beside the object, yet not so small that 24-bit depth buffers run out of precision.
        znear=max(_NEAR_SHARE_OF_DIAGONAL * diagonal_m, 1e-6),
    )


def _warn_of_lost_offset(camera: ClipCamera) -> None:
    center_px = np.array([camera.width_px, camera.height_px]) / 2
    offset_px = camera.intrinsics[:2, 2] - center_px
    if np.abs(offset_px).max() > _CENTERED_PX:
        _LOGGER.warning(
            "camera: glTF has no principal point, so the image shifts by (%.1f, %.1f) px; "
            "the exact intrinsics are in the camera's extras, and a USD export keeps them",
            *offset_px,
        )
