"""Numbered images as a source of frames: a folder, a glob, a pattern or a single file."""

import dataclasses
import logging
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from animator.errors import InputError
from animator.scene.image_file import IMAGE_SUFFIXES, Picture, read_image
from animator.scene.natural_order import (
    describe_ranges,
    frame_numbers,
    missing_ranges,
    natural_key,
)
from animator.scene.selection import FrameSelection

logger = logging.getLogger(__name__)

_NUMBER_FIELD = re.compile(r"%(?:0?(?P<width>\d+))?d|(?P<hashes>#+)")
"""`%d`, `%4d`, `%04d` or `####`."""
_GLOB_CHARACTERS = frozenset("*?[")


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImageSequence:
    """Images in the order of the clip, not yet decoded."""

    path: Path
    """What the user named: a folder, a glob, a pattern or a file."""
    folder: Path
    """The folder the images lie in."""
    files: tuple[Path, ...]
    """The images."""
    numbers: tuple[int, ...]
    """Their numbers, strictly increasing."""

    container_fps: None = None
    """Images do not say how fast they were taken."""

    @property
    def frame_count(self) -> int:
        """Number of images."""
        return len(self.files)

    def pictures(self, selection: FrameSelection) -> Iterator[tuple[int, Picture]]:
        """Decode the selected images; yields position in the sequence and picture.

        Raises:
            InputError: If a selected number does not exist, or an image cannot be decoded.
        """
        for position in selection.positions(self.numbers, str(self.path)):
            yield position, read_image(self.files[position])


def is_pattern(path: Path) -> bool:
    """Return whether the last part of a path is a printf or `####` pattern, or the path a glob."""
    return bool(_NUMBER_FIELD.search(path.name)) or is_glob(path)


def is_glob(path: Path) -> bool:
    """Return whether a path holds glob characters."""
    return not _GLOB_CHARACTERS.isdisjoint(str(path))


def static_folder(path: Path) -> Path:
    """Return the innermost folder of a pattern that is not part of the pattern itself."""
    folder = path.parent
    while is_glob(folder) and not folder.is_dir():
        folder = folder.parent
    return folder


def images_in_folder(folder: Path) -> ImageSequence:
    """List the images of a folder, not of its subfolders.

    Raises:
        InputError: If there is none.
    """
    files = _visible_files(folder)
    images = [file for file in files if file.suffix.lower() in IMAGE_SUFFIXES]
    if not images:
        raise InputError(
            f"{folder}: expected images ({_suffixes()}), found {_describe_files(files)}; "
            "is this the folder of the frames?"
        )
    return _ordered(folder, folder, images)


def images_from_file(path: Path) -> ImageSequence:
    """Take a single image as a clip of one frame."""
    return _ordered(path, path.parent, [path])


def images_from_pattern(path: Path) -> ImageSequence:
    """List the images that match `frame_%04d.png`, `frame.####.png` or `shot/*.png`.

    The number field of a pattern gives the frame numbers.

    Raises:
        InputError: If nothing matches, or the pattern has two number fields.
    """
    fields = list(_NUMBER_FIELD.finditer(path.name))
    if not fields:
        return _images_from_glob(path)
    if len(fields) > 1:
        raise InputError(f"{path}: expected one number field, found {len(fields)}.")
    field = fields[0]
    width = len(field["hashes"] or "") or int(field["width"] or 1)
    digits = rf"([0-9]{{{width}}}|[1-9][0-9]{{{width},17}})"
    before, after = path.name[: field.start()], path.name[field.end() :]
    expected = re.compile(re.escape(before) + digits + re.escape(after))
    folder = path.parent
    if not folder.is_dir():
        raise InputError(f"{path}: there is no folder {folder}.")
    files = _visible_files(folder)
    matches = ((expected.fullmatch(file.name), file) for file in files)
    numbered = sorted((int(match[1]), file) for match, file in matches if match)
    if not numbered:
        raise InputError(
            f"{path}: no file matches the pattern; the folder holds {_describe_files(files)}."
        )
    numbers = tuple(number for number, _ in numbered)
    _report_gaps(path, numbers)
    return ImageSequence(
        path=path, folder=folder, files=tuple(file for _, file in numbered), numbers=numbers
    )


def _images_from_glob(path: Path) -> ImageSequence:
    folder = static_folder(path)
    matches = folder.glob(str(path.relative_to(folder)))
    files = [file for file in matches if _is_visible_file(file)]
    images = [file for file in files if file.suffix.lower() in IMAGE_SUFFIXES]
    if not images:
        raise InputError(
            f"{path}: the pattern matches {_describe_files(files)}, expected images "
            f"({_suffixes()}); put it in quotes if the shell expanded it."
        )
    return _ordered(path, images[0].parent, images)


def _ordered(path: Path, folder: Path, images: list[Path]) -> ImageSequence:
    images = sorted(images, key=lambda image: natural_key(str(image)))
    numbers = frame_numbers([image.name for image in images])
    _report_gaps(path, numbers)
    return ImageSequence(path=path, folder=folder, files=tuple(images), numbers=numbers)


def _report_gaps(path: Path, numbers: tuple[int, ...]) -> None:
    gaps = missing_ranges(numbers)
    if gaps:
        logger.warning(
            "%s: the frame numbers have %d gap(s), missing: %s; the numbers are kept.",
            path,
            len(gaps),
            describe_ranges(gaps),
        )


def _visible_files(folder: Path) -> list[Path]:
    try:
        return [file for file in folder.iterdir() if _is_visible_file(file)]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror or error}.") from error


def _is_visible_file(file: Path) -> bool:
    """Tell files from folders and from hidden ones, such as the `._` twins that macOS leaves."""
    return file.is_file() and not file.name.startswith(".")


def _describe_files(files: Iterable[Path]) -> str:
    counts = Counter(file.suffix.lower() or "suffixless" for file in files)
    kinds = ", ".join(f"{count} {suffix} files" for suffix, count in counts.most_common(5))
    return kinds or "no files"


def _suffixes() -> str:
    return ", ".join(sorted(IMAGE_SUFFIXES))
