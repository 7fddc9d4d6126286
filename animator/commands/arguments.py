"""Flags from the definition of the options, and options from flags and file."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from animator.commands.config_file import read_config_file
from animator.commands.value_kind import ValueKind, ValueKindError
from animator.config import AnimateOptions, default_of, option_infos

SOURCE_HELP = "folder, glob or printf pattern of images, or a video file"


def add_animate_arguments(parser: argparse.ArgumentParser) -> None:
    """Add FRAMES, every option of `AnimateOptions` and `--config` to a parser."""
    parser.add_argument("source", metavar="FRAMES", type=Path, help=SOURCE_HELP)
    groups: dict[str, argparse._ArgumentGroup] = {}
    for name, info in option_infos().items():
        if info.group not in groups:
            groups[info.group] = parser.add_argument_group(info.group)
        add_option(groups[info.group], name)
    parser.add_argument(
        "--config",
        metavar="TOML",
        type=Path,
        help="file of options named like the flags (`every = 2`); a flag wins over the file",
    )


def add_option(group: argparse._ActionsContainer, name: str, *, default: Any = None) -> None:
    """Add one option; it stays out of the namespace unless its flag is given.

    Args:
        group: The parser, or one of its groups.
        name: Field of `AnimateOptions`.
        default: What the help shows, if the command has a default of its own.
    """
    info = option_infos()[name]
    shown_default = default_of(name) if default is None else default
    flag = "--" + name.replace("_", "-")
    flags = [info.short, flag] if info.short else [flag]
    shown = info.help.replace("%", "%%")
    common: dict[str, Any] = {"dest": name, "default": argparse.SUPPRESS}
    if info.kind.metavar is None:
        # Help shows the flag that changes something; its opposite undoes a TOML file.
        hidden = argparse.SUPPRESS
        on_help, off_help = (hidden, shown) if shown_default else (shown, hidden)
        negated = flag.replace("--", "--no-", 1)
        group.add_argument(*flags, action="store_true", help=on_help, **common)
        group.add_argument(negated, action="store_false", help=off_help, **common)
        return
    if shown_default not in (None, ()):
        shown += f" (default: {shown_default})"
    group.add_argument(
        *flags,
        action="append" if info.is_repeatable else "store",
        type=_argument_type(info.kind),
        metavar=info.kind.metavar,
        help=shown,
        **common,
    )


def animate_options(arguments: argparse.Namespace) -> AnimateOptions:
    """Combine flags, TOML file and defaults: flag over file over default.

    Raises:
        InputError: If the file is not usable.
    """
    values = read_config_file(arguments.config) if arguments.config else {}
    values |= given_options(arguments)
    return AnimateOptions(**values)


def given_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the options whose flags were given."""
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in vars(arguments).items()
        if name in option_infos()
    }


def _argument_type(kind: ValueKind) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        try:
            return kind.parse(text)
        except ValueKindError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return read
