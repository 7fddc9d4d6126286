"""Pictures of the true motion from views that the method never sees."""

import dataclasses
import logging
from pathlib import Path, PurePosixPath

from animator.errors import InputError
from animator.evaluation.image_scores import Picture
from animator.scene import read_cameras
from animator.scene.image_file import read_image
from animator.scene.json_record import JsonRecord, read_json
from animator.scene.natural_order import last_number
from animator.types import Camera

logger = logging.getLogger(__name__)

FILE_NAME = "transforms_eval.json"


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class HeldOutView:
    """One picture; it is read when it is wanted."""

    camera: Camera
    number: int
    """Frame it shows."""
    name: str
    """Of the view, the same over all frames."""
    path: Path

    def picture(self) -> Picture:
        """Read the picture.

        Raises:
            InputError: If it cannot be read, or has not the size that its camera says.
        """
        image = read_image(self.path)
        if image.size_px != (self.camera.width_px, self.camera.height_px):
            raise InputError(
                f"{self.path}: expected {self.camera.width_px}x{self.camera.height_px} pixels as "
                f"{FILE_NAME} says, found {image.size_px[0]}x{image.size_px[1]}."
            )
        return on_black(image.rgb, image.alpha)


def on_black(rgb, alpha) -> Picture:
    """Composite a picture with straight alpha, both uint8, on black."""
    coverage = alpha.astype("float32") / 255.0
    return Picture(rgb=rgb.astype("float32") / 255.0 * coverage[..., None], alpha=coverage)


def read_held_out_views(folder: Path) -> tuple[HeldOutView, ...]:
    """Read the cameras of `transforms_eval.json`; none if the scene has no such file.

    Raises:
        InputError: If it is malformed, names no frame, or a picture outside the scene.
    """
    path = folder / FILE_NAME
    if not path.is_file():
        logger.warning("%s: no %s, so no figures from held-out views.", folder, FILE_NAME)
        return ()
    cameras = read_cameras(path)
    records = JsonRecord.check(read_json(path), str(path)).records("frames")
    return tuple(
        _view(folder, record, camera) for record, camera in zip(records, cameras, strict=True)
    )


def _view(folder: Path, record: JsonRecord, camera: Camera) -> HeldOutView:
    name = PurePosixPath(record.text("file_path"))
    if name.is_absolute() or ".." in name.parts:
        raise InputError(f"{record.where}: file_path: expected a path in the scene, found {name}.")
    number = int(record.number("frame")) if "frame" in record else last_number(str(name))
    if number is None:
        raise InputError(
            f"{record.where}: expected the number of the frame it shows, in `frame` or in "
            f"file_path, found {name}."
        )
    return HeldOutView(
        camera=camera, number=number, name=name.parent.name or "view", path=folder / name
    )
