"""Find what lies beside the frames: Gaussians, cameras and masks."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path

from animator.errors import InputError
from animator.scene.cameras import is_camera_path
from animator.scene.image_sequence import is_pattern, static_folder
from animator.scene.ply import OTHER_SPLAT_SUFFIXES

_GAUSSIAN_NAMES = ("init.ply", "point_cloud.ply", "model.ply")
_CAMERA_NAMES = ("transforms_train.json", "transforms.json", "cameras.json", "sparse/0")
_FRAME_CAMERA_NAME = "transforms_frames.json"
_MASKS_NAME = "masks"

AUTO = "auto"
"""The value of `--frame-camera` that asks to find the clip's camera."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneOverrides:
    """What the user named by a flag, instead of leaving it to the search."""

    gaussians: Path | None = None
    """`--gaussians`: the rest Gaussians."""
    cameras: Path | None = None
    """`--cameras`: the capture's cameras."""
    frame_camera: Path | str | None = None
    """`--frame-camera`: the clip's camera, or `auto` to find it."""
    masks: Path | None = None
    """`--masks`: a folder with one mask a frame."""
    depth: Path | None = None
    """`--depth`: a folder with one depth map a frame."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Found:
    """A file or folder, and why it was chosen."""

    path: Path
    reason: str
    """Such as `found beside the frames` or `--cameras`."""
    is_explicit: bool = False
    """The user named it."""

    def __str__(self) -> str:
        return f"{self.path} ({self.reason})"


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneFiles:
    """The inputs of one run."""

    frames: Path
    """The source of the frames, as the user gave it."""
    gaussians: Found
    """The rest Gaussians."""
    cameras: Found | None
    """The capture's cameras; None if there are none, which needs `frame_camera`."""
    frame_camera: Found | None
    """The clip's camera; None if it must be found."""
    masks: Found | None
    """The folder of masks."""
    depth: Found | None
    """The folder of depth maps, only where the user named it: unlike the others it is never searched for."""

    def notes(self) -> tuple[str, ...]:
        """Say what was chosen, and why; one sentence each."""
        frame_camera = self.frame_camera or "to be found by comparing with the capture's views"
        return (
            f"Gaussians: {self.gaussians}.",
            f"Capture cameras: {self.cameras or 'none'}.",
            f"Clip camera: {frame_camera}.",
            f"Mask folder: {self.masks or 'none'}.",
            *(() if self.depth is None else (f"Depth folder: {self.depth}.",)),
        )


def discover(frames: str | Path, overrides: SceneOverrides | None = None) -> SceneFiles:
    """Choose the inputs that belong to a source of frames.

    Each is taken from its flag, else searched in the frames' folder and then in its parent (for a
    video or a single image: in the folder it lies in); depth maps come from their flag only. No
    file is opened.

    Args:
        frames: What the user gave: a folder, a glob, a pattern, an image or a video.
        overrides: What the user named by a flag.

    Raises:
        InputError: If the frames or a named file do not exist, there are no Gaussians or several
            that could be meant, or no cameras at all.
    """
    overrides = overrides or SceneOverrides()
    source = Path(frames).expanduser()
    folders = _search_folders(source)
    is_camera_wanted = overrides.frame_camera is None or str(overrides.frame_camera) == AUTO
    if not is_camera_wanted:
        frame_camera = _named(overrides.frame_camera, "--frame-camera")
    elif overrides.frame_camera is None:
        frame_camera = _first(folders, (_FRAME_CAMERA_NAME,), source)
    else:
        frame_camera = None
    cameras = _named(overrides.cameras, "--cameras") or _first(folders, _CAMERA_NAMES, source)
    if frame_camera is None and cameras is None:
        raise InputError(
            f"No cameras found: looked for {', '.join((_FRAME_CAMERA_NAME, *_CAMERA_NAMES))} in "
            f"{_list(folders)}. Give the cameras the splat was captured with (--cameras), or the "
            "camera of the clip (--frame-camera)."
        )
    return SceneFiles(
        frames=source,
        gaussians=_named(overrides.gaussians, "--gaussians") or _find_gaussians(folders, source),
        cameras=cameras,
        frame_camera=frame_camera,
        masks=_named(overrides.masks, "--masks") or _first(folders, (_MASKS_NAME,), source),
        depth=_named(overrides.depth, "--depth"),
    )


def _search_folders(source: Path) -> tuple[Path, ...]:
    if source.is_dir():
        if not any(source.iterdir()):
            raise InputError(f"{source}: expected the images of the clip, found an empty folder.")
        return _with_parent(source)
    if source.is_file():
        return (source.parent,)
    if not is_pattern(source):
        raise InputError(
            f"{source}: there is no such file or folder; give the folder, pattern or video of the "
            "frames."
        )
    return _with_parent(static_folder(source))


def _with_parent(folder: Path) -> tuple[Path, ...]:
    # The parent of `.` or `..` is only known once it is made absolute.
    parent = folder.resolve().parent if folder.name in ("", "..") else folder.parent
    return (folder, parent)


def _named(path: Path | str | None, flag: str) -> Found | None:
    if path is None:
        return None
    path = Path(path).expanduser()
    if not path.exists():
        raise InputError(f"{path}: there is no such file ({flag}).")
    return Found(path=path, reason=flag, is_explicit=True)


def _first(folders: tuple[Path, ...], names: tuple[str, ...], source: Path) -> Found | None:
    """Return the first of some names that exists, near folders before far ones."""
    for folder in folders:
        for name in names:
            path = folder / name
            is_right_kind = path.is_dir() if name == _MASKS_NAME else is_camera_path(path)
            if is_right_kind:
                return Found(path=path, reason=_place(folder, source))
    return None


def _find_gaussians(folders: tuple[Path, ...], source: Path) -> Found:
    for folder in folders:
        candidates = sorted(path for path in _files(folder) if path.suffix.lower() == ".ply")
        if not candidates:
            continue
        place = _place(folder, source)
        if len(candidates) == 1:
            return Found(path=candidates[0], reason=f"the only .ply file, {place}")
        for name in _GAUSSIAN_NAMES:
            if folder / name in candidates:
                return Found(path=folder / name, reason=place)
        raise InputError(
            f"{folder}: found {len(candidates)} .ply files ("
            f"{', '.join(path.name for path in candidates[:8])}) and none is called "
            f"{' or '.join(_GAUSSIAN_NAMES)}; say which one holds the Gaussians with --gaussians."
        )
    others = sorted(
        path
        for folder in folders
        for path in _files(folder)
        if path.suffix.lower() in OTHER_SPLAT_SUFFIXES
    )
    hint = f" {others[0]} must be converted to .ply first." if others else ""
    raise InputError(
        f"No Gaussians found: looked for *.ply in {_list(folders)}; name the splat with "
        f"--gaussians.{hint}"
    )


def _files(folder: Path) -> Iterable[Path]:
    try:
        return [
            path for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")
        ]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror or error}.") from error


def _place(folder: Path, source: Path) -> str:
    return "found in the frames' folder" if folder == source else "found beside the frames"


def _list(folders: tuple[Path, ...]) -> str:
    return " and ".join(str(folder) for folder in folders)
