"""Rules for our own clip file: the zip is plain, and the clip keeps the promises of its fields."""

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from exporters.check.problem import Problem
from exporters.clip_io import load_clip
from exporters.errors import ClipError

_LISTED = re.compile(r"\n {2}- ")
_WORDS = re.compile(
    r"(?P<place>[\w.]+): (?:expected (?P<expected>.*?), (?:got|found) )?(?P<found>.*)", re.DOTALL
)


def check_clip(path: Path) -> Iterator[Problem]:
    """Check a `.splatimate.npz`: each array against the size of its entry, then `Clip.validate`."""
    try:
        with zipfile.ZipFile(path) as archive:
            problems = [p for entry in archive.infolist() for p in entry_problems(archive, entry)]
    except (zipfile.BadZipFile, NotImplementedError, EOFError, ValueError) as error:
        yield Problem(place="archive", expected="a zip of numpy arrays", found=str(error))
        return
    yield from problems
    if problems:
        return
    try:
        load_clip(path)
    except ClipError as error:
        yield from _in_words(str(error).removeprefix(f"{path}: "))


def entry_problems(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Iterator[Problem]:
    """An entry is stored as it is and holds what its header promises: nothing can swell in memory."""
    if entry.compress_type != zipfile.ZIP_STORED or entry.flag_bits & 0x1:
        yield Problem(place=entry.filename, expected="an array, stored", found="compressed data")
        return
    try:
        with archive.open(entry) as stream:
            version = np.lib.format.read_magic(stream)
            read = {(1, 0): np.lib.format.read_array_header_1_0}.get(
                version, np.lib.format.read_array_header_2_0
            )
            shape, _, dtype = read(stream)
            promised = stream.tell() + dtype.itemsize * int(np.prod(shape, dtype=object))
    except (ValueError, zipfile.BadZipFile, EOFError) as error:
        yield Problem(place=entry.filename, expected="a numpy array", found=str(error))
        return
    if dtype.hasobject or promised != entry.file_size:
        yield Problem(
            place=entry.filename,
            expected=f"{dtype} of shape {shape}, {promised} bytes",
            found=f"{entry.file_size} bytes",
        )


def _in_words(message: str) -> Iterator[Problem]:
    """Turn the message of `Clip.validate` into problems, one a line."""
    _, *lines = _LISTED.split(message)
    for line in lines or [message]:
        words = _WORDS.fullmatch(line)
        if words is None:
            yield Problem(place="clip", expected="a clip", found=line)
            continue
        expected = words["expected"] or "a clip that keeps its promises"
        yield Problem(place=words["place"], expected=expected, found=words["found"])
