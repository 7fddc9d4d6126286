"""Cameras from a COLMAP sparse model, binary or text.

Layout and lens models: https://colmap.github.io/format.html and
https://colmap.github.io/cameras.html. COLMAP's pixel (0.5, 0.5) is the centre of the top-left
pixel and its camera axes are OpenCV's, as ours.
"""

import dataclasses
import logging
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from animator.errors import InputError
from animator.scene.byte_cursor import ByteCursor
from animator.scene.natural_order import natural_key
from animator.scene.pinhole import Lens, rigid_transform
from animator.types import Camera

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class _LensModel:
    """How the parameters of one of COLMAP's lens models are laid out."""

    name: str
    parameter_count: int
    focal_count: int
    """1: the same along x and y; 2: fx, fy; 0: not a perspective lens."""


_LENS_MODELS = {
    0: _LensModel(name="SIMPLE_PINHOLE", parameter_count=3, focal_count=1),
    1: _LensModel(name="PINHOLE", parameter_count=4, focal_count=2),
    2: _LensModel(name="SIMPLE_RADIAL", parameter_count=4, focal_count=1),
    3: _LensModel(name="RADIAL", parameter_count=5, focal_count=1),
    4: _LensModel(name="OPENCV", parameter_count=8, focal_count=2),
    5: _LensModel(name="OPENCV_FISHEYE", parameter_count=8, focal_count=0),
    6: _LensModel(name="FULL_OPENCV", parameter_count=12, focal_count=2),
    7: _LensModel(name="FOV", parameter_count=5, focal_count=0),
    8: _LensModel(name="SIMPLE_RADIAL_FISHEYE", parameter_count=4, focal_count=0),
    9: _LensModel(name="RADIAL_FISHEYE", parameter_count=5, focal_count=0),
    10: _LensModel(name="THIN_PRISM_FISHEYE", parameter_count=12, focal_count=0),
    11: _LensModel(name="RAD_TAN_THIN_PRISM_FISHEYE", parameter_count=16, focal_count=0),
}
_MODEL_BY_NAME = {model.name: model for model in _LENS_MODELS.values()}


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Image:
    """One registered image: where it was taken, and with which lens."""

    quat_wxyz: Sequence[float]
    translation: Sequence[float]
    camera_id: int
    name: str
    where: str


def is_colmap_model(folder: Path) -> bool:
    """Return whether a folder holds a sparse model."""
    return any(
        (folder / f"cameras{suffix}").is_file() and (folder / f"images{suffix}").is_file()
        for suffix in (".bin", ".txt")
    )


def cameras_from_colmap(folder: Path) -> tuple[Camera, ...]:
    """Read the registered images of a sparse model (`cameras` and `images`, .bin before .txt).

    Returns:
        One camera an image, in the natural order of their names.

    Raises:
        InputError: If a file is cut off or malformed, or a lens is no perspective one.
    """
    if (folder / "images.bin").is_file() and (folder / "cameras.bin").is_file():
        lenses = dict(_read_binary_lenses(folder / "cameras.bin"))
        images = list(_read_binary_images(folder / "images.bin"))
    else:
        lenses = dict(_read_text_lenses(folder / "cameras.txt"))
        images = list(_read_text_images(folder / "images.txt"))
    if not images:
        raise InputError(
            f"{folder}: expected registered images, found none; did the reconstruction succeed?"
        )
    images.sort(key=lambda image: natural_key(image.name))
    return tuple(_camera(image, lenses) for image in images)


def _camera(image: _Image, lenses: dict[int, Lens]) -> Camera:
    lens = lenses.get(image.camera_id)
    if lens is None:
        raise InputError(
            f"{image.where}: image {image.name!r} refers to camera {image.camera_id}, which is "
            "not among the cameras of the model; do both files belong together?"
        )
    rotation = _rotation_from_quat(np.asarray(image.quat_wxyz), image.where)
    cam_from_world = rigid_transform(rotation, np.asarray(image.translation), where=image.where)
    return lens.camera(cam_from_world, name=image.name, where=image.where)


def _rotation_from_quat(quat_wxyz: np.ndarray, where: str) -> np.ndarray:
    largest = float(np.abs(quat_wxyz).max())
    if not 1e-6 < largest < 1e6:
        raise InputError(f"{where}: expected a unit quaternion, found {quat_wxyz.tolist()}.")
    w, x, y, z = quat_wxyz / np.linalg.norm(quat_wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _lens(
    model: _LensModel, size_px: tuple[int, int], parameters: Sequence[float], where: str
) -> Lens:
    if model.focal_count == 0:
        raise InputError(
            f"{where}: expected a perspective lens, found the model {model.name}; "
            "run `colmap image_undistorter` and give the model it writes."
        )
    fx_px, fy_px = parameters[0], parameters[model.focal_count - 1]
    cx_px, cy_px, *distortion = parameters[model.focal_count :]
    largest = max((abs(coefficient) for coefficient in distortion), default=0.0)
    if largest > 0:
        logger.warning(
            "%s: ignored the %s distortion (largest coefficient %.3g); run `colmap "
            "image_undistorter` if the silhouettes do not meet.",
            where,
            model.name,
            largest,
        )
    return Lens(
        fx_px=fx_px,
        fy_px=fy_px,
        cx_px=cx_px,
        cy_px=cy_px,
        width_px=size_px[0],
        height_px=size_px[1],
    )


def _read_binary_lenses(path: Path) -> Iterator[tuple[int, Lens]]:
    with ByteCursor.open(path) as cursor:
        for _ in range(cursor.count(least_bytes_each=48)):
            camera_id, model_id, width_px, height_px = cursor.unpack("<iiQQ")
            model = _LENS_MODELS.get(model_id)
            where = f"{path}: camera {camera_id}"
            if model is None:
                raise InputError(f"{where}: expected a lens model 0..11, found {model_id}.")
            parameters = cursor.unpack(f"<{model.parameter_count}d")
            yield camera_id, _lens(model, (width_px, height_px), parameters, where)


def _read_binary_images(path: Path) -> Iterator[_Image]:
    with ByteCursor.open(path) as cursor:
        for _ in range(cursor.count(least_bytes_each=73)):
            image_id, *pose, camera_id = cursor.unpack("<i7di")
            name = cursor.text()
            cursor.skip(24 * cursor.count(least_bytes_each=24))  # 2-D points: x, y, 3-D point
            yield _Image(
                quat_wxyz=pose[:4],
                translation=pose[4:],
                camera_id=camera_id,
                name=name,
                where=f"{path}: image {image_id}",
            )


def _read_text_lenses(path: Path) -> Iterator[tuple[int, Lens]]:
    for number, line in _lines(path):
        if not line or line.startswith("#"):
            continue
        where = f"{path}: line {number}"
        fields = line.split()
        model = _MODEL_BY_NAME.get(fields[1]) if len(fields) > 1 else None
        if model is None:
            raise InputError(
                f"{where}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS..., found {line[:80]!r}."
            )
        if len(fields) != 4 + model.parameter_count:
            raise InputError(
                f"{where}: expected {model.parameter_count} parameters for {model.name}, "
                f"found {len(fields) - 4}."
            )
        camera_id, width_px, height_px = (
            int(_number(field, where)) for field in (fields[0], *fields[2:4])
        )
        parameters = [_number(field, where) for field in fields[4:]]
        yield camera_id, _lens(model, (width_px, height_px), parameters, where)


def _read_text_images(path: Path) -> Iterator[_Image]:
    lines = _lines(path)
    for number, line in lines:
        if not line or line.startswith("#"):
            continue
        where = f"{path}: line {number}"
        fields = line.split(maxsplit=9)
        if len(fields) != 10:
            raise InputError(
                f"{where}: expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, "
                f"found {line[:80]!r}."
            )
        pose = [_number(field, where) for field in fields[1:8]]
        next(lines, None)  # the image's 2-D points: one line, empty if it has none
        yield _Image(
            quat_wxyz=pose[:4],
            translation=pose[4:],
            camera_id=int(_number(fields[8], where)),
            name=fields[9],
            where=where,
        )


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, start=1):
                yield number, line.strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as text: {error}.") from error


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f"{where}: expected a finite number, found {text[:40]!r}.")
    return value
