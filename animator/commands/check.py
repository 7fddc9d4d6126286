"""`splatimate check`: hold files to the rules of their formats; needs no torch."""

import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from animator.commands.exit_code import ExitCode
from exporters.check import Problem, check_file
from exporters.errors import ClipError

logger = logging.getLogger(__name__)


def run_check(paths: Sequence[Path]) -> ExitCode:
    """Check files, or folders of PLY files; problems go to stdout, one a line.

    Returns:
        `BAD_INPUT` if one cannot be checked at all, else `NOT_WRITTEN` if one has a problem, else
        `DONE`. All are looked at.
    """
    is_sound = can_be_checked = True
    for path in paths:
        try:
            problems = check_file(path)
        except ClipError as error:
            logger.error("%s", error)
            can_be_checked = False
            continue
        sys.stdout.write(describe_problems(path, problems))
        if problems:
            is_sound = False
        else:
            logger.info("%s: no problem found.", path)
    if not can_be_checked:
        return ExitCode.BAD_INPUT
    return ExitCode.DONE if is_sound else ExitCode.NOT_WRITTEN


def describe_problems(path: Path, problems: Sequence[Problem], limit: int | None = None) -> str:
    """Return one line a problem, and how many are left out beyond a limit."""
    lines = [f"{path}: {problem}\n" for problem in problems[:limit]]
    if len(lines) < len(problems):
        more = len(problems) - len(lines)
        lines.append(f"{path}: and {more} more; `splatimate check {path}` lists all\n")
    return "".join(lines)
