"""Errors that a user can act on."""


class ClipError(ValueError):
    """A clip or a clip file is not usable; the message lists every problem found."""


class WriteError(OSError):
    """An output could not be written; the command line ends with exit code 5."""
