"""`splatimate export`: write a saved clip again, in other formats; needs no torch."""

import logging
from pathlib import Path

from animator.commands.clip_files import write_clip_files
from animator.commands.exit_code import ExitCode
from animator.commands.outputs import OutputPlan
from animator.config import AnimateOptions
from exporters.clip_io import load_clip

logger = logging.getLogger(__name__)


def run_export(clip_path: Path, plan: OutputPlan, options: AnimateOptions) -> ExitCode:
    """Write a saved clip to the planned files.

    Args:
        clip_path: A `.splatimate.npz` file.
        plan: Where to; checked.
        options: What goes into the files.

    Returns:
        `DONE`, or `NOT_WRITTEN` if a file breaks a rule of its format.

    Raises:
        ClipError: If the clip cannot be read.
        WriteError: If a file cannot be written.
    """
    clip = load_clip(clip_path)
    logger.info(
        "%s: %d Gaussians, %d joints, %d keys, %g frames per second.",
        clip_path,
        len(clip.splats),
        len(clip.rig),
        len(clip.tracks),
        clip.fps,
    )
    plan.make_folders()
    broken = write_clip_files(clip, plan, options)
    return ExitCode.NOT_WRITTEN if broken else ExitCode.DONE
