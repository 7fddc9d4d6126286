"""Cameras of any known format, told apart by content."""

from pathlib import Path

from animator.errors import InputError
from animator.scene.colmap import cameras_from_colmap, is_colmap_model
from animator.scene.inria import cameras_from_inria
from animator.scene.json_record import read_json
from animator.scene.nerfstudio import cameras_from_transforms
from animator.types import Camera

_KNOWN_FORMATS = (
    "transforms.json (nerfstudio, Blender), cameras.json (INRIA) or a COLMAP model "
    "(the folder with cameras and images, .bin or .txt)"
)


def is_camera_path(path: Path) -> bool:
    """Return whether a path is a file, or the folder of a COLMAP model."""
    return path.is_file() or is_colmap_model(path)


def read_cameras(path: str | Path) -> tuple[Camera, ...]:
    """Read all cameras of a file or a COLMAP folder.

    Args:
        path: `transforms*.json`, `cameras.json`, a COLMAP folder (`sparse/0`, or a folder that
            contains it), or one of its files.

    Returns:
        The cameras, at least one; in the order of the file, COLMAP's by name.

    Raises:
        InputError: If it is missing, of an unknown format, or malformed.
    """
    path = Path(path)
    if path.is_dir():
        for folder in (path, path / "0", path / "sparse" / "0"):
            if is_colmap_model(folder):
                return cameras_from_colmap(folder)
        raise InputError(
            f"{path}: expected cameras.bin and images.bin (or .txt) of a COLMAP model, found "
            f"neither there nor in its folders 0 and sparse/0. Known formats: {_KNOWN_FORMATS}."
        )
    if not path.is_file():
        raise InputError(f"{path}: there is no such camera file. Known formats: {_KNOWN_FORMATS}.")
    if path.suffix in (".bin", ".txt") and is_colmap_model(path.parent):
        return cameras_from_colmap(path.parent)
    if path.suffix.lower() != ".json":
        raise InputError(
            f"{path}: expected cameras, found a {path.suffix or 'suffixless'} file. "
            f"Known formats: {_KNOWN_FORMATS}."
        )
    content = read_json(path)
    if isinstance(content, dict) and "frames" in content:
        return cameras_from_transforms(content, path)
    if isinstance(content, list):
        return cameras_from_inria(content, path)
    raise InputError(
        f'{path}: expected cameras, found JSON without a list "frames" (nerfstudio) and that is '
        f"no list of cameras (INRIA). Known formats: {_KNOWN_FORMATS}."
    )
