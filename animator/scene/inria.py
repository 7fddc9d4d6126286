"""Cameras from the `cameras.json` that INRIA's 3D Gaussian Splatting writes beside its models.

`position` and `rotation` are the camera-to-world transformation, with OpenCV axes:
`camera_to_JSON` in https://github.com/graphdeco-inria/gaussian-splatting (utils/camera_utils.py).
"""

from pathlib import Path

from animator.errors import InputError
from animator.scene.json_record import JsonRecord
from animator.scene.pinhole import Lens, rigid_inverse, rigid_transform
from animator.types import Camera


def cameras_from_inria(entries: object, path: Path) -> tuple[Camera, ...]:
    """Convert the content of a `cameras.json`; the principal point is the image's centre.

    Args:
        entries: The parsed JSON.
        path: The file, for messages.

    Returns:
        One camera an entry, in the order of the file.

    Raises:
        InputError: If a field is missing or wrong.
    """
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{path}: expected a list with at least one camera, found none.")
    records = [
        JsonRecord.check(entry, f"{path}: camera {index}") for index, entry in enumerate(entries)
    ]
    return tuple(_camera(record) for record in records)


def _camera(record: JsonRecord) -> Camera:
    width_px, height_px = int(record.number("width")), int(record.number("height"))
    lens = Lens(
        fx_px=record.number("fx"),
        fy_px=record.number("fy"),
        cx_px=width_px / 2,
        cy_px=height_px / 2,
        width_px=width_px,
        height_px=height_px,
    )
    world_from_cam = rigid_transform(
        record.array("rotation", (3, 3)),
        record.array("position", (3,)),
        where=f"{record.where}: rotation",
    )
    name = record.text("img_name") if "img_name" in record else ""
    return lens.camera(rigid_inverse(world_from_cam), name=name, where=record.where)
