"""What the user sees on stderr: log lines and, on a terminal, a progress bar."""

import contextlib
import dataclasses
import logging
import os
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

logger = logging.getLogger(__name__)

_OUR_LOGGERS = ("animator", "exporters", "py.warnings")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Verbosity:
    """How much to say."""

    is_quiet: bool = False
    """Errors only."""
    is_verbose: bool = False
    """Everything, with tracebacks."""

    @property
    def level(self) -> int:
        """The lowest log level shown."""
        if self.is_verbose:
            return logging.DEBUG
        return logging.ERROR if self.is_quiet else logging.INFO


@contextlib.contextmanager
def logging_to_stderr(verbosity: Verbosity) -> "Iterator[Console | None]":
    """Show our log lines on stderr for the block.

    Args:
        verbosity: How much to show.

    Tracebacks of errors that end the block are shown at the level DEBUG.

    Yields:
        The rich console of the log lines if stderr is a terminal, for a progress bar to share it.
    """
    console = _terminal() if not verbosity.is_quiet else None
    handler = _plain_handler() if console is None else _rich_handler(console)
    handler.setLevel(verbosity.level)
    loggers = [logging.getLogger(name) for name in _OUR_LOGGERS]
    levels = [(ours.level, ours.propagate) for ours in loggers]
    for ours in loggers:
        ours.addHandler(handler)
        ours.setLevel(verbosity.level)
        ours.propagate = False
    logging.captureWarnings(True)
    try:
        yield console
    except Exception:
        logger.debug("Where it happened:", exc_info=True)
        raise
    finally:
        logging.captureWarnings(False)
        for ours, (level, propagate) in zip(loggers, levels, strict=True):
            ours.removeHandler(handler)
            ours.setLevel(level)
            ours.propagate = propagate


class _PlainFormatter(logging.Formatter):
    """The message alone; warnings and errors say that they are."""

    def format(self, record: logging.LogRecord) -> str:
        message = super().format(record)
        return f"{record.levelname.lower()}: {message}" if record.levelno > 20 else message


def _plain_handler() -> logging.Handler:
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_PlainFormatter("%(message)s"))
    return handler


def _rich_handler(console: "Console") -> logging.Handler:
    from rich.logging import RichHandler

    handler = RichHandler(
        console=console, show_time=False, show_path=False, markup=False, highlighter=None
    )
    handler.setFormatter(logging.Formatter("%(message)s"))
    return handler


def _terminal() -> "Console | None":
    if not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        return None
    from rich.console import Console

    return Console(stderr=True)
