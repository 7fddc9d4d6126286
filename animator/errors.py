"""Errors that a user can act on."""


class InputError(ValueError):
    """Something the user supplied cannot be used; the command line ends with exit code 3.

    The message names the file, the field, what was expected, what was found and what to do.
    """
