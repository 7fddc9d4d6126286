"""Write a clip to all planned files, and check what was written."""

import logging
from pathlib import Path

from animator.commands.check import describe_problems
from animator.commands.export_choices import export_options
from animator.commands.outputs import OutputPlan
from animator.config import AnimateOptions
from exporters.check import check_file, is_known
from exporters.clip import Clip
from exporters.errors import WriteError
from exporters.registry import export_clip

logger = logging.getLogger(__name__)

_SHOWN = 20


def write_clip_files(clip: Clip, plan: OutputPlan, options: AnimateOptions) -> tuple[Path, ...]:
    """Write the clip, its caches and its assets, each whole or not at all.

    The clip comes first: from it everything else can be written again. A file that breaks a rule of
    its format stays, to be looked at, and so do all others; the log lists what is wrong.

    Returns:
        The files that break a rule; none unless a writer is wrong.

    Raises:
        WriteError: If a file cannot be written; the message says how to go on from the clip.
    """
    paths = (plan.clip, *plan.assets, plan.usd_cache, plan.ply_folder)
    choices = export_options(options)
    clip_path: Path | None = None
    broken: list[Path] = []
    for path in paths:
        if path is None:
            continue
        try:
            written = export_clip(clip, path, choices)
        except WriteError as error:
            if clip_path is None:
                raise
            raise WriteError(
                f"{error}. The fit is not lost: `splatimate export {clip_path} --out FILE` "
                "writes it without fitting again"
            ) from error
        logger.info("Wrote %s", path)
        if path == plan.clip:
            clip_path = path
        broken += _broken_files((path,) if path.is_dir() else written)
    return tuple(broken)


def _broken_files(written: tuple[Path, ...]) -> list[Path]:
    """Check files just written; log the problems and return the files that have any."""
    broken = []
    for path in filter(is_known, written):
        problems = check_file(path, is_trusted=True)
        if problems:
            logger.error(
                "%s breaks %d rules of its format. It stays, but do not rely on it; this is a bug, "
                "please report it with these lines:\n%s",
                path,
                len(problems),
                describe_problems(path, problems, _SHOWN).rstrip(),
            )
            broken.append(path)
    return broken
