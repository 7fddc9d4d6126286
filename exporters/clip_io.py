"""A clip on disk: `NAME.splatimate.npz`, exact, without pickle, the same bytes for the same clip.

The file is an ordinary `.npz` (a zip of `.npy` arrays): `numpy.load` reads it anywhere. The arrays
are named by their place in the clip, `splats.positions`; `metadata` holds the rest as JSON in UTF-8
bytes. A change of the layout that an older program cannot do without raises `FORMAT_VERSION`; a part
that it can leave out, as `uncertainty`, does not.
"""

import dataclasses
import io
import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from exporters.atomic import replacing
from exporters.clip import Clip, ClipCamera, Rig, Skin, Splats, Tracks, Uncertainty
from exporters.errors import ClipError
from exporters.options import ExportOptions

FORMAT_NAME = "splatimate-clip"
FORMAT_VERSION = 1
SUFFIX = ".splatimate.npz"

_ZIP_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time a zip can hold; any fixed one would do
_PARTS = {
    "splats": Splats,
    "rig": Rig,
    "skin": Skin,
    "tracks": Tracks,
    "camera": ClipCamera,
    "uncertainty": Uncertainty,
}
_LATER_PARTS = {"uncertainty"}  # not named in the first files of this version
_PLAIN_FIELDS = ("name", "fps", "up_axis", "meters_per_unit", "source_frames")


def save_clip(
    clip: Clip, path: str | Path, options: ExportOptions | None = None
) -> tuple[Path, ...]:
    """Write a clip, bit-exact.

    Args:
        clip: The clip; it is validated first, so that no unusable file is ever written.
        path: The target, by custom ending in `.splatimate.npz`; replaced whole.
        options: Not used: the file holds the clip itself, whatever is made of it.

    Returns:
        The one file written.

    Raises:
        ClipError: If the clip is not valid.
        WriteError: If the place cannot be written.
    """
    clip.validate()
    arrays = {"metadata": np.frombuffer(_metadata_json(clip).encode(), np.uint8)}
    for part_name in _PARTS:
        part = getattr(clip, part_name)
        if part is not None:
            for field, value in _fields(part).items():
                if isinstance(value, np.ndarray):
                    arrays[f"{part_name}.{field}"] = value
    with replacing(path) as staged, zipfile.ZipFile(staged, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=_ZIP_EPOCH)
            with archive.open(entry, "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, array, allow_pickle=False)
    return (Path(path),)


def load_clip(path: str | Path) -> Clip:
    """Read a clip that `save_clip` wrote, and validate it.

    Args:
        path: The `.splatimate.npz` file.

    Raises:
        ClipError: If there is no such file, or it is foreign, damaged, of a newer version, or not
            a valid clip.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            return _read(path, stream)
    except OSError as error:
        raise ClipError(f"{path}: cannot be read ({error.strerror or error})") from error


def _read(path: Path, stream: io.BufferedReader) -> Clip:
    foreign = f"{path}: not a clip; expected a {SUFFIX} file written by splatimate"
    if not zipfile.is_zipfile(stream):
        raise ClipError(
            f"{foreign}, found no complete zip archive; was it cut off? Then write it again"
        )
    try:
        with zipfile.ZipFile(stream) as archive:
            if "metadata.npy" not in archive.namelist():
                raise ClipError(f"{foreign}, found an archive without `metadata`")
            arrays = {
                name.removesuffix(".npy"): _read_array(archive, name) for name in archive.namelist()
            }
        metadata = json.loads(arrays["metadata"].tobytes().decode())
        _check_version(path, metadata)
        clip = _assembled(metadata, arrays)
    except ClipError:
        raise
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, KeyError, TypeError) as error:
        raise ClipError(f"{path}: damaged clip ({error}); write it again") from error
    try:
        clip.validate()
    except ClipError as error:
        raise ClipError(f"{path}: {error}") from error
    return clip


def _read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    with archive.open(name) as stream:
        array = np.lib.format.read_array(stream, allow_pickle=False)
        stream.read()  # to the end: only there the zip checks its checksum
    return array


def _check_version(path: Path, metadata: dict[str, Any]) -> None:
    if metadata.get("format") != FORMAT_NAME:
        raise ClipError(
            f"{path}: not a clip; expected format {FORMAT_NAME!r}, found {metadata.get('format')!r}"
        )
    version = metadata.get("version")
    if not isinstance(version, int) or not 1 <= version <= FORMAT_VERSION:
        raise ClipError(
            f"{path}: clip of version {version}, this program reads up to {FORMAT_VERSION}; "
            "upgrade splatimate (pip install -U splatimate) or write the clip again"
        )


def _metadata_json(clip: Clip) -> str:
    metadata: dict[str, Any] = {"format": FORMAT_NAME, "version": FORMAT_VERSION}
    metadata |= {field: getattr(clip, field) for field in _PLAIN_FIELDS}
    for part_name in _PARTS:
        part = getattr(clip, part_name)
        metadata[part_name] = (
            None
            if part is None
            else {
                field: value
                for field, value in _fields(part).items()
                if not isinstance(value, np.ndarray)
            }
        )
    return json.dumps(metadata, sort_keys=True, ensure_ascii=False, default=_plain_number)


def _plain_number(value: object) -> int | float:
    """Turn a numpy scalar, which JSON does not know, into the number it holds."""
    if isinstance(value, np.integer | np.floating):
        return value.item()
    raise TypeError(f"cannot be written as JSON: {value!r}")


def _assembled(metadata: dict[str, Any], arrays: dict[str, np.ndarray]) -> Clip:
    parts: dict[str, Any] = {}
    for part_name, part_type in _PARTS.items():
        plain = metadata.get(part_name) if part_name in _LATER_PARTS else metadata[part_name]
        if plain is not None:
            prefix = f"{part_name}."
            of_part = {
                name.removeprefix(prefix): array
                for name, array in arrays.items()
                if name.startswith(prefix)
            }
            plain = {k: tuple(v) if isinstance(v, list) else v for k, v in plain.items()}
            parts[part_name] = part_type(**of_part, **plain)
    plain_fields = {field: metadata[field] for field in _PLAIN_FIELDS}
    plain_fields["source_frames"] = tuple(plain_fields["source_frames"])
    return Clip(**parts, **plain_fields)


def _fields(part: Any) -> dict[str, Any]:
    return {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
