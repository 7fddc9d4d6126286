"""How a command ends."""

import enum


class ExitCode(enum.IntEnum):
    """Exit codes of every command."""

    DONE = 0
    BUG = 1
    """An error nobody foresaw; Python's own code."""
    USAGE = 2
    """The command line itself is wrong; argparse's own code."""
    BAD_INPUT = 3
    BELOW_QUALITY_GATE = 4
    """Everything is written, but the render does not cover the frames well enough."""
    NOT_WRITTEN = 5
    """An output could not be written, or a file breaks a rule of its format."""
    INTERRUPTED = 130
    """128 + SIGINT, as shells expect."""
