"""The file an interrupted run leaves beside its output, and finds again."""

import dataclasses
import logging
from pathlib import Path

from animator.commands.version import program_version
from animator.errors import InputError
from animator.pipeline import FitConfig
from animator.scene import Scene
from animator.sequence.checkpoint import (
    Checkpoint,
    fingerprint_of,
    read_checkpoint,
    write_checkpoint,
)
from animator.sequence.solved_frame import SolvedFrame
from exporters.atomic import replacing

logger = logging.getLogger(__name__)


def run_fingerprint(scene: Scene, config: FitConfig) -> str:
    """Digest what the solved frames depend on: content, not names and dates of files.

    In-betweens and their weights are left out: they are made after the last frame, and may be
    changed on the way.
    """
    defaults = FitConfig()
    solving = dataclasses.replace(
        config, inbetween=defaults.inbetween, interpolation=defaults.interpolation
    )
    inputs = (scene.gaussians, scene.capture_cameras, scene.frame_cameras)
    frames = (scene.frames.images, scene.frames.alphas, scene.frames.depths)
    return fingerprint_of(program_version(), solving, inputs, frames)


class ProgressFile:
    """Keeps every solved frame on disk until the outputs are written."""

    def __init__(self, path: Path, fingerprint: str) -> None:
        self._path = path
        self._fingerprint = fingerprint
        self._solved: list[SolvedFrame] = []

    def resume(self, frame_count: int) -> tuple[SolvedFrame, ...]:
        """Read the frames of an interrupted run.

        Args:
            frame_count: Length of the clip.

        Returns:
            Its frames; none if it left no file.

        Raises:
            InputError: If the file is damaged, or of a run of other inputs or options.
        """
        if not self._path.exists():
            logger.warning("--resume: there is no %s; starting with the first frame.", self._path)
            return ()
        checkpoint = read_checkpoint(self._path)
        if checkpoint.fingerprint != self._fingerprint or len(checkpoint.solved) > frame_count:
            raise InputError(
                f"{self._path}: --resume needs the inputs, options and version of the interrupted "
                "run, and they differ; give them as they were, or drop --resume to start over."
            )
        self._solved = list(checkpoint.solved)
        logger.info("Resuming after %d of %d frames.", len(self._solved), frame_count)
        return checkpoint.solved

    def keep(self, index: int, solved: SolvedFrame) -> None:
        """Add a solved frame.

        Raises:
            WriteError: If the disk fails.
        """
        assert index == len(self._solved), "frames come in order"
        self._solved.append(solved)
        checkpoint = Checkpoint(fingerprint=self._fingerprint, solved=tuple(self._solved))
        with replacing(self._path) as staged:
            write_checkpoint(checkpoint, staged)

    def announce(self) -> None:
        """Tell the user of an interrupted run what is kept."""
        if self._solved:
            logger.warning(
                "%d solved frames are kept in %s; the same command with --resume continues there.",
                len(self._solved),
                self._path,
            )

    def remove(self) -> None:
        """Delete the file: the outputs are complete."""
        self._path.unlink(missing_ok=True)
