"""Outputs that appear whole or not at all."""

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from exporters.errors import WriteError


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a path to write a file to; move it to `path` when the block ends well.

    The yielded path has the same file name, suffix included, and lies in a hidden folder beside the
    target, so on the same disk: the move is one step, and a reader sees the old file or the new.
    Whatever ends the block early, Ctrl-C too, leaves the target as it was and nothing beside it.

    Args:
        path: The target; missing parent folders are made.

    Raises:
        WriteError: If the place cannot be written, or the disk fails while it is.
    """
    target = Path(path)
    if target.is_dir():
        raise WriteError(
            f"{target}: expected the path of a file, found a folder; name a file in it"
        )
    with _staging_folder(target) as staging:
        staged = staging / target.name
        yield staged
        if not staged.is_file():
            raise WriteError(f"{target}: nothing was written to {staged}")
        staged.replace(target)


@contextlib.contextmanager
def replacing_folder(path: str | Path) -> Iterator[Path]:
    """Yield an empty folder to fill; move it to `path` when the block ends well.

    A folder already at `path` is removed with all its files once the new one is in place: whether
    that may be is for the caller to decide first.

    Args:
        path: The target; missing parent folders are made.

    Raises:
        WriteError: If the place cannot be written, or the disk fails while it is.
    """
    target = Path(path)
    if target.exists() and not target.is_dir():
        raise WriteError(f"{target}: expected a folder or nothing, found a file; remove it first")
    with _staging_folder(target) as staging:
        staged = staging / target.name
        staged.mkdir()
        yield staged
        previous = staging / f"{target.name}.previous"
        if target.exists():
            target.rename(previous)
        try:
            staged.rename(target)
        except BaseException:
            if previous.exists():
                previous.rename(target)
            raise


@contextlib.contextmanager
def _staging_folder(target: Path) -> Iterator[Path]:
    """Make a hidden folder beside the target for the block; errors name the target."""
    if not target.name:
        raise WriteError(f"{target}: expected the path of a file or folder to write, with a name")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=f".{target.name[:40]}.", dir=target.parent))
    except OSError as error:
        raise WriteError(_advice(target, error)) from error
    try:
        yield staging
    except WriteError:
        raise
    except OSError as error:
        raise WriteError(_advice(target, error)) from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _advice(target: Path, error: OSError) -> str:
    reason = error.strerror or str(error)
    return (
        f"{target}: cannot be written ({reason}); "
        f"check that {target.parent} is a folder you may write to, with free space"
    )
