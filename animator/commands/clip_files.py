"""Write a clip to all planned files."""

import logging
from pathlib import Path

from animator.commands.export_choices import export_options
from animator.commands.outputs import OutputPlan
from animator.config import AnimateOptions
from exporters.clip import Clip
from exporters.errors import WriteError
from exporters.registry import export_clip

logger = logging.getLogger(__name__)


def write_clip_files(clip: Clip, plan: OutputPlan, options: AnimateOptions) -> None:
    """Write the clip, its caches and its assets, each whole or not at all.

    The clip comes first: from it everything else can be written again.

    Raises:
        WriteError: If a file cannot be written; the message says how to go on from the clip.
    """
    paths = (plan.clip, *plan.assets, plan.usd_cache, plan.ply_folder)
    choices = export_options(options)
    clip_path: Path | None = None
    for path in paths:
        if path is None:
            continue
        try:
            export_clip(clip, path, choices)
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
