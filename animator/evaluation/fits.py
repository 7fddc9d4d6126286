"""Fits on disk: done once, found again, and continued where they were interrupted."""

import dataclasses
import hashlib
import json
import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import animator
from animator.errors import InputError
from animator.evaluation.methods import Method
from animator.evaluation.motion import Motion, motion_at_rest, motion_of_clip
from animator.evaluation.rgb_only import RgbOnlyConfig, fit_rgb_only
from animator.evaluation.tasks import Assignment
from animator.pipeline import FitConfig, fit
from animator.render.protocol import Renderer
from animator.rig.bake import ClipLabels
from animator.sequence.cameras import locate_cameras
from animator.sequence.checkpoint import (
    Checkpoint,
    fingerprint_of,
    read_checkpoint,
    write_checkpoint,
)
from animator.sequence.solved_frame import SolvedFrame
from exporters.atomic import replacing
from exporters.clip import Clip
from exporters.clip_io import SUFFIX, load_clip, save_clip

logger = logging.getLogger(__name__)

_NO_METHOD = ("commands", "evaluation", "report")
"""Packages whose code changes no result."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FitRequest:
    """A method on a task on a scene."""

    method: Method
    assignment: Assignment
    config: FitConfig
    """What `animate` would use, with the switches of the method."""
    folder: Path
    """Where the result is kept."""
    name: str
    """For the log, such as `robot, full`."""

    @property
    def full_config(self) -> FitConfig:
        """The configuration with all that the method and the task change."""
        config = dataclasses.replace(self.config, inbetween=self.assignment.inbetween)
        return self.method.adjust(config)

    @property
    def fingerprint(self) -> str:
        """Digest of the inputs and of every choice."""
        scene = self.assignment.scene
        inputs = (scene.gaussians, scene.capture_cameras, scene.frame_cameras)
        shown = (scene.frames.images, scene.frames.alphas, scene.frames.depths)
        frames = (*shown, list(scene.frames.numbers))
        choices = self.full_config if self.method.kind == "rig" else RgbOnlyConfig()
        return fingerprint_of(self.method.kind, choices, inputs, frames)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FittedMethod:
    """The result of a method."""

    motion: Motion
    """At the given frames."""
    clip: Clip | None
    """The rig, with in-betweens if the task wants them; None for methods without one."""
    seconds_per_frame: float
    """Wall time of a solved frame [s]; NaN if nothing was solved."""


def fit_once(
    request: FitRequest,
    renderer: Renderer,
    *,
    overwrite: bool = False,
    on_frame: Callable[[int, SolvedFrame | None], None] = lambda index, solved: None,
) -> FittedMethod:
    """Return the kept result of a request, or fit, and keep it.

    Args:
        request: What to fit.
        renderer: For methods that are not ours.
        overwrite: Fit again, even if a result is kept.
        on_frame: Called after each frame that is solved.

    Raises:
        InputError: If the scene cannot be fitted.
        WriteError: If the result cannot be kept.
    """
    if request.method.kind == "still":
        scene = request.assignment.scene
        motion = motion_at_rest(scene.gaussians, scene.frames.numbers)
        return FittedMethod(motion=motion, clip=None, seconds_per_frame=float("nan"))
    if not overwrite:
        kept = _kept(request)
        if kept is not None:
            return kept
    if request.method.kind == "free":
        return _fit_free(request, renderer, on_frame)
    return _fit_rig(request, on_frame, overwrite=overwrite)


def code_digest() -> str:
    """Digest the code that a result depends on."""
    digest = hashlib.sha256()
    root = Path(animator.__file__).parent
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] not in _NO_METHOD:
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _kept(request: FitRequest) -> FittedMethod | None:
    """Read a result that is there already, if it is one of the same request."""
    try:
        record = json.loads(_record_path(request).read_text(encoding="utf-8"))
        if record["fingerprint"] != request.fingerprint:
            logger.info("%s: the kept result is of other inputs or options.", request.name)
            return None
        if record["code"] != code_digest():
            logger.warning(
                "%s: the kept result is of another version of the code; --overwrite fits again.",
                request.name,
            )
        seconds = float(record["seconds_per_frame"])
        if request.method.kind == "free":
            return FittedMethod(motion=_read_motion(request), clip=None, seconds_per_frame=seconds)
        clip = load_clip(_clip_path(request))
    except (OSError, ValueError, KeyError, TypeError):
        return None
    logger.info("%s: kept result, not fitted again.", request.name)
    return FittedMethod(motion=motion_of_clip(clip), clip=clip, seconds_per_frame=seconds)


def _fit_rig(
    request: FitRequest,
    on_frame: Callable[[int, SolvedFrame | None], None],
    *,
    overwrite: bool,
) -> FittedMethod:
    progress_path = request.folder / "progress.npz"
    fingerprint = fingerprint_of(request.fingerprint, code_digest())
    solved = [] if overwrite else _progress(progress_path, fingerprint)
    if solved:
        logger.info("%s: continued after %d frames.", request.name, len(solved))
    resumed = tuple(solved)

    def keep(index: int, frame: SolvedFrame) -> None:
        solved.append(frame)
        with replacing(progress_path) as staged:
            checkpoint = Checkpoint(fingerprint=fingerprint, solved=tuple(solved))
            write_checkpoint(checkpoint, staged)
        on_frame(index, frame)

    scene = request.assignment.scene
    labels = ClipLabels(name=request.folder.name, fps=scene.frames.fps)
    fitted = fit(scene, labels, request.full_config, resume_from=resumed, on_frame=keep)
    seconds = [sum(frame.stats.seconds.values()) for frame in fitted.solved[1:]]
    save_clip(fitted.clip, _clip_path(request))
    return _record(
        request, motion_of_clip(fitted.clip), fitted.clip, float(np.mean(seconds)), progress_path
    )


def _fit_free(
    request: FitRequest, renderer: Renderer, on_frame: Callable[[int, SolvedFrame | None], None]
) -> FittedMethod:
    scene = request.assignment.scene
    cameras = locate_cameras(scene, scene.gaussians.to(renderer.device), renderer)
    started_s = time.monotonic()
    motion = fit_rgb_only(
        scene, cameras, renderer, RgbOnlyConfig(), lambda index: on_frame(index, None)
    )
    seconds = (time.monotonic() - started_s) / max(len(motion) - 1, 1)
    with replacing(_motion_path(request)) as staged, staged.open("wb") as stream:
        np.savez(stream, positions=motion.positions, quats_wxyz=motion.quats_wxyz)
    return _record(request, motion, None, seconds, None)


def _record(
    request: FitRequest,
    motion: Motion,
    clip: Clip | None,
    seconds_per_frame: float,
    progress_path: Path | None,
) -> FittedMethod:
    """Say that the result is complete, as the last thing."""
    record: dict[str, Any] = {
        "fingerprint": request.fingerprint,
        "code": code_digest(),
        "seconds_per_frame": round(seconds_per_frame, 4),
    }
    with replacing(_record_path(request)) as staged:
        staged.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    if progress_path is not None:
        progress_path.unlink(missing_ok=True)
    return FittedMethod(motion=motion, clip=clip, seconds_per_frame=seconds_per_frame)


def _progress(path: Path, fingerprint: str) -> list[SolvedFrame]:
    try:
        checkpoint = read_checkpoint(path)
    except InputError:
        return []
    return list(checkpoint.solved) if checkpoint.fingerprint == fingerprint else []


def _read_motion(request: FitRequest) -> Motion:
    scene = request.assignment.scene
    with np.load(_motion_path(request), allow_pickle=False) as archive:
        return Motion(
            gaussians=scene.gaussians,
            numbers=scene.frames.numbers,
            positions=archive["positions"],
            quats_wxyz=archive["quats_wxyz"],
        )


def _record_path(request: FitRequest) -> Path:
    return request.folder / "fit.json"


def _clip_path(request: FitRequest) -> Path:
    return request.folder / f"clip{SUFFIX}"


def _motion_path(request: FitRequest) -> Path:
    return request.folder / "motion.npz"
