"""The solved camera as a UsdGeomCamera."""

import logging

import numpy as np
from pxr import Gf, Usd, UsdGeom

from exporters import keyframes, quaternions
from exporters.clip import Clip, ClipCamera
from exporters.usd import values

HORIZONTAL_APERTURE = 36.0
"""Width of the film [tenths of a scene unit, USD's unit for lenses]: full frame in cm scenes."""

NEAR_SHARE = 1e-3  # near over far clipping distance: deep enough for close-ups, shallow for 24 bits

_SKEW_TOLERANCE_PX = 1e-6

_USD_FROM_OPENCV = np.diag([1.0, -1.0, -1.0])  # OpenCV looks along +z, y down; USD along -z, y up

_log = logging.getLogger(__name__)


def define_camera(
    stage: Usd.Stage, clip: Clip, path: str, swept_extent: np.ndarray
) -> UsdGeom.Camera | None:
    """Define the clip's camera, if it has one, time-sampled if it moves.

    It projects as the intrinsics do.

    With fx = fy, cx = w/2 and cy = h/2 this is an ordinary lens. Unequal focal lengths go into the
    height of the aperture, the principal point into its offsets: the image edges u = 0 and u = w
    lie at -cx/fx and (w - cx)/fx of the focal length, which is aperture/2 either side of the
    offset (`GfCamera::GetFrustum`); upwards, the edge v = 0 lies at +cy/fy.

    The pose is written as translation and quaternion, so that it interpolates as a rotation.

    Args:
        stage: Receives the prim.
        clip: The clip.
        path: Path of the prim.
        swept_extent: Box of the whole motion [scene unit], which the clipping planes must hold.
    """
    camera = clip.camera
    if camera is None:
        return None
    intrinsics = camera.intrinsics
    width, height = camera.width_px, camera.height_px
    if abs(intrinsics[0, 1]) > _SKEW_TOLERANCE_PX:
        _log.warning("%s: USD cameras have no skew; %g px left out", clip.name, intrinsics[0, 1])
    focal_length = intrinsics[0, 0] * HORIZONTAL_APERTURE / width
    vertical_aperture = height * focal_length / intrinsics[1, 1]

    usd_camera = UsdGeom.Camera.Define(stage, path)
    usd_camera.CreateProjectionAttr(UsdGeom.Tokens.perspective)
    usd_camera.CreateFocalLengthAttr(float(focal_length))
    usd_camera.CreateHorizontalApertureAttr(HORIZONTAL_APERTURE)
    usd_camera.CreateVerticalApertureAttr(float(vertical_aperture))
    usd_camera.CreateHorizontalApertureOffsetAttr(
        float(HORIZONTAL_APERTURE * (0.5 - intrinsics[0, 2] / width))
    )
    usd_camera.CreateVerticalApertureOffsetAttr(
        float(vertical_aperture * (intrinsics[1, 2] / height - 0.5))
    )
    _add_pose(usd_camera, clip, camera)
    usd_camera.CreateClippingRangeAttr(_clipping_range(camera, swept_extent))
    return usd_camera


def _add_pose(usd_camera: UsdGeom.Camera, clip: Clip, camera: ClipCamera) -> None:
    rotations = camera.cam_from_world[:, :3, :3].swapaxes(1, 2)
    positions = -np.einsum("tij,tj->ti", rotations, camera.cam_from_world[:, :3, 3])
    quats_wxyz = keyframes.continue_signs(quaternions.from_matrices(rotations @ _USD_FROM_OPENCV))
    translate = usd_camera.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
    orient = usd_camera.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    if len(positions) == 1:
        times = [Usd.TimeCode.Default()]
    else:
        times = [Usd.TimeCode(float(code)) for code in keyframes.key_codes(clip)]
    for time, position, quat_wxyz in zip(times, positions, quats_wxyz, strict=True):
        translate.Set(values.vector(position), time)
        orient.Set(values.quat(quat_wxyz), time)


def _clipping_range(camera: ClipCamera, swept_extent: np.ndarray) -> Gf.Vec2f:
    """Return near and far distances that hold the whole motion as seen from every pose."""
    low, high = swept_extent
    center, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    depths = camera.cam_from_world[:, 2, :3] @ center + camera.cam_from_world[:, 2, 3]
    far = max(float(np.max(depths) + radius), float(radius)) * 2
    return Gf.Vec2f(far * NEAR_SHARE, far)
