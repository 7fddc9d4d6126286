"""A bounded reader of untrusted binary files: nothing is believed before it is in the file."""

import dataclasses
import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from animator.errors import InputError

_LONGEST_NAME = 4096


@dataclasses.dataclass(kw_only=True)
class ByteCursor:
    """A position in a file that is mapped to memory; moves as it reads."""

    path: Path
    data: mmap.mmap | bytes
    position: int = 0

    @classmethod
    @contextmanager
    def open(cls, path: Path) -> "Iterator[ByteCursor]":
        """Map a file.

        Raises:
            InputError: If it cannot be read, or is empty.
        """
        try:
            with path.open("rb") as file:
                if path.stat().st_size == 0:
                    raise InputError(f"{path}: expected data, found an empty file.")
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                    yield cls(path=path, data=data)
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}.") from error

    def unpack(self, layout: str) -> tuple:
        """Read one `struct` layout."""
        size = struct.calcsize(layout)
        self._require(size)
        values = struct.unpack_from(layout, self.data, self.position)
        self.position += size
        return values

    def count(self, *, least_bytes_each: int) -> int:
        """Read a uint64 count of items that must still fit into the file."""
        (count,) = self.unpack("<Q")
        left = len(self.data) - self.position
        if count * least_bytes_each > left:
            raise InputError(
                f"{self.path}: cut off or no COLMAP file: byte {self.position - 8} promises "
                f"{count:,} items of at least {least_bytes_each} bytes, only {left:,} bytes "
                "follow; copy it again."
            )
        return count

    def text(self) -> str:
        """Read a string that ends with a zero byte."""
        end = self.data.find(b"\0", self.position, self.position + _LONGEST_NAME)
        if end < 0:
            raise InputError(f"{self.path}: no end of the name that starts at {self.position}.")
        text = self.data[self.position : end].decode("utf-8", errors="replace")
        self.position = end + 1
        return text

    def skip(self, size: int) -> None:
        """Move on by a number of bytes that must be in the file."""
        self._require(size)
        self.position += size

    def _require(self, size: int) -> None:
        left = len(self.data) - self.position
        if size > left:
            raise InputError(
                f"{self.path}: cut off: expected {size:,} more bytes at byte {self.position:,}, "
                f"found {left:,}; copy it again."
            )
