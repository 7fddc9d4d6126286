"""Cameras from nerfstudio and Blender `transforms*.json`.

The format stores camera-to-world matrices with OpenGL axes (+x right, +y up, -z forward):
https://docs.nerf.studio/quickstart/data_conventions.html.
"""

import logging
import os
from pathlib import Path, PurePath, PurePosixPath

import numpy as np

from animator.errors import InputError
from animator.scene.image_file import image_size_px
from animator.scene.json_record import JsonRecord
from animator.scene.pinhole import Lens, rigid_inverse, rigid_transform
from animator.types import Camera

logger = logging.getLogger(__name__)

_OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
_DISTORTION_FIELDS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
_PERSPECTIVE_MODELS = {
    "OPENCV", "FULL_OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE",
}  # fmt: skip
_LENS_FIELDS = ("w", "h", "fl_x", "fl_y", "cx", "cy", "camera_angle_x", "camera_angle_y")
_IMAGE_SUFFIXES = ("", ".png", ".jpg", ".jpeg")


def cameras_from_transforms(transforms: object, path: Path) -> tuple[Camera, ...]:
    """Convert the content of a `transforms.json`.

    Lens fields may stand at the top, in a frame, or both; the frame wins.

    Args:
        transforms: The parsed JSON.
        path: The file, for messages and to find images whose size is not given.

    Returns:
        One camera a frame, in the order of the file.

    Raises:
        InputError: If a field is missing or wrong, or the lens is no perspective one.
    """
    shared = JsonRecord.check(transforms, str(path))
    cameras = []
    distorted = []
    for frame in shared.records("frames"):
        name = _image_name(frame)
        _require_perspective(shared, frame)
        distortion = _largest_distortion(shared, frame)
        if distortion > 0:
            distorted.append(distortion)
        lens = _read_lens(shared, frame, path)
        cameras.append(lens.camera(_read_pose(frame), name=name, where=frame.where))
    if distorted:
        logger.warning(
            "%s: ignored the lens distortion of %d of %d cameras (largest coefficient %.3g); "
            "undistort the images if the silhouettes do not meet.",
            path,
            len(distorted),
            len(cameras),
            max(distorted),
        )
    if "applied_transform" in shared:
        logger.warning(
            "%s was written by ns-process-data. A splat trained by nerfstudio lies in a frame "
            "that was re-oriented and scaled once more (dataparser_transforms.json); if object "
            "and cameras do not meet, export the splat in the frame of this file.",
            path,
        )
    return tuple(cameras)


def _image_name(frame: JsonRecord) -> str:
    return str(PurePosixPath(frame.text("file_path"))) if "file_path" in frame else ""


def _require_perspective(shared: JsonRecord, frame: JsonRecord) -> None:
    for record in (frame, shared):
        if "camera_model" not in record:
            continue
        model = record.text("camera_model")
        if model.upper() not in _PERSPECTIVE_MODELS:
            raise InputError(
                f"{record.where}: camera_model: expected a perspective lens "
                f"({', '.join(sorted(_PERSPECTIVE_MODELS))}), found {model!r}; "
                "undistort the images to a pinhole camera first."
            )
        return


def _largest_distortion(shared: JsonRecord, frame: JsonRecord) -> float:
    holders = ((field, frame if field in frame else shared) for field in _DISTORTION_FIELDS)
    return max(
        (abs(holder.number(field)) for field, holder in holders if field in holder), default=0.0
    )


def _read_pose(frame: JsonRecord) -> np.ndarray:
    """Return cam_from_world with OpenCV axes, shape (4, 4)."""
    matrix = frame.array("transform_matrix", (4, 4), (3, 4))
    where = f"{frame.where}: transform_matrix"
    world_from_opengl = rigid_transform(matrix[:3, :3], matrix[:3, 3], where=where)
    return rigid_inverse(world_from_opengl @ _OPENGL_FROM_OPENCV)


def _read_lens(shared: JsonRecord, frame: JsonRecord, path: Path) -> Lens:
    fields = {
        field: holder.number(field)
        for field in _LENS_FIELDS
        for holder in (frame if field in frame else shared,)
        if field in holder
    }
    for focal, angle in (("fl_x", "camera_angle_x"), ("fl_y", "camera_angle_y")):
        # A frame's own field of view beats a focal length given for all frames.
        if angle in frame and focal not in frame:
            fields.pop(focal, None)
    if "w" in fields and "h" in fields:
        width_px, height_px = int(fields["w"]), int(fields["h"])
    else:
        width_px, height_px = _size_of_image(frame, path)
    fx_px = fields.get("fl_x") or _focal_px(fields.get("camera_angle_x"), width_px)
    fy_px = fields.get("fl_y") or _focal_px(fields.get("camera_angle_y"), height_px)
    focal_px = fx_px or fy_px
    if focal_px is None:
        raise InputError(
            f"{frame.where}: expected a focal length, found none of fl_x, fl_y, camera_angle_x "
            "and camera_angle_y in the frame or at the top of the file; add fl_x [px]."
        )
    return Lens(
        fx_px=fx_px or focal_px,
        fy_px=fy_px or focal_px,
        cx_px=fields.get("cx", width_px / 2),
        cy_px=fields.get("cy", height_px / 2),
        width_px=width_px,
        height_px=height_px,
    )


def _focal_px(angle_rad: float | None, side_px: int) -> float | None:
    return None if angle_rad is None else 0.5 * side_px / float(np.tan(0.5 * angle_rad))


def _size_of_image(frame: JsonRecord, path: Path) -> tuple[int, int]:
    """Take the size from the image a frame names, if it lies inside the file's own folder."""
    advice = "add w and h [px] to the file"
    if "file_path" not in frame:
        raise InputError(f"{frame.where}: the image size (w, h) is missing; {advice}.")
    name = frame.text("file_path")
    inside = PurePath(os.path.normpath(name))
    if "\0" in name or inside.is_absolute() or ".." in inside.parts:
        raise InputError(
            f"{frame.where}: the image size (w, h) is missing, and the image {name!r} lies "
            f"outside {path.parent}, where it is not opened; {advice}."
        )
    for suffix in _IMAGE_SUFFIXES:
        image_path = path.parent / f"{inside}{suffix}"
        if image_path.is_file():
            return image_size_px(image_path)
    raise InputError(
        f"{frame.where}: the image size (w, h) is missing, and there is no image "
        f"{path.parent / inside} to take it from; {advice}."
    )
