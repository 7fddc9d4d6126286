"""Everything one run reads, in memory."""

import dataclasses
import logging

from animator.scene.cameras import read_cameras
from animator.scene.clip_cameras import clip_cameras
from animator.scene.depth_maps import read_depth_maps
from animator.scene.discovery import SceneFiles
from animator.scene.frames import ClipReading, FrameOptions, open_frames, read_clip
from animator.scene.masks import find_masks
from animator.scene.ply import read_ply
from animator.types import Camera, Frames, Gaussians

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """The inputs of the animation."""

    gaussians: Gaussians
    """The Gaussians at rest, on the CPU."""
    capture_cameras: tuple[Camera, ...]
    """The cameras the splat was captured with, empty if none were found."""
    frames: Frames
    """The clip, with masks as alphas, and depth maps if the user gave some."""
    frame_cameras: tuple[Camera, ...] | None
    """The clip's camera at the frames' size: one if static, else T; None if it must be found."""
    notes: tuple[str, ...]
    """What was chosen and why, one sentence each."""


def read_scene(files: SceneFiles, options: FrameOptions | None = None) -> Scene:
    """Read what `discover` found.

    Args:
        files: The files.
        options: Which frames to read, and how.

    Raises:
        InputError: If anything cannot be used; the message says what to do.
    """
    # What is quick to read, and to refuse, comes before the frames.
    source = open_frames(files.frames)
    gaussians = read_ply(files.gaussians.path)
    capture_cameras = () if files.cameras is None else read_cameras(files.cameras.path)
    given_cameras = None if files.frame_camera is None else read_cameras(files.frame_camera.path)
    clip = read_clip(source, options or FrameOptions())
    frame_cameras = None
    if given_cameras is not None:
        frame_cameras = clip_cameras(given_cameras, clip, where=str(files.frame_camera))
    # Before the masks, which can take long to find.
    depths = None if files.depth is None else read_depth_maps(clip.frames, files.depth.path)
    masks = find_masks(
        clip.frames,
        None if files.masks is None else files.masks.path,
        is_folder_explicit=files.masks is not None and files.masks.is_explicit,
    )
    return Scene(
        gaussians=gaussians,
        capture_cameras=capture_cameras,
        frames=dataclasses.replace(clip.frames, alphas=masks.alphas, depths=depths),
        frame_cameras=frame_cameras,
        notes=(
            _describe_frames(clip, files),
            f"Gaussians: {len(gaussians):,} from {files.gaussians}.",
            f"Capture cameras: {len(capture_cameras)} from {files.cameras or 'nowhere'}.",
            _describe_frame_cameras(frame_cameras, files),
            masks.note,
            *(() if depths is None else (f"Depth: {len(depths)} maps from {files.depth}.",)),
        ),
    )


def _describe_frames(clip: ClipReading, files: SceneFiles) -> str:
    frames = clip.frames
    height_px, width_px = frames.images.shape[1:3]
    shrunk = ""
    if (width_px, height_px) != (clip.width_px, clip.height_px):
        shrunk = f", averaged down from {clip.width_px}x{clip.height_px}"
    return (
        f"Frames: {len(frames)} of {clip.frame_count} from {files.frames}, {width_px}x{height_px} "
        f"pixels{shrunk}, {frames.fps:g} frames per second ({clip.fps_reason})."
    )


def _describe_frame_cameras(cameras: tuple[Camera, ...] | None, files: SceneFiles) -> str:
    if cameras is None:
        return "Clip camera: none given; it is found by comparing with the capture's views."
    kind = "static" if len(cameras) == 1 else f"moving, {len(cameras)} poses"
    return f"Clip camera: {kind}, from {files.frame_camera}."
