"""A scene whose motion is known, and where scenes lie."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from animator.errors import InputError
from animator.evaluation.held_out_views import HeldOutView, on_black, read_held_out_views
from animator.evaluation.image_scores import Picture
from animator.evaluation.truth import PARTS_FILE, POINTS_FILE, Truth, read_truth
from animator.render.protocol import Renderer
from animator.scene import Scene, discover, read_scene
from animator.types import Camera

FRAMES_FOLDER = "frames"


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class TruthScene:
    """Everything that is known of one scene."""

    name: str
    folder: Path
    scene: Scene
    """All frames, with the clip's true camera."""
    cameras: tuple[Camera, ...]
    """The true camera of every frame."""
    truth: Truth
    held_out: tuple[HeldOutView, ...]

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of all frames."""
        return self.scene.frames.numbers

    def rows(self, numbers: Sequence[int]) -> np.ndarray:
        """Return the positions of frames in the clip, and in the truth."""
        return np.array([self.numbers.index(number) for number in numbers], np.int64)

    def front_picture(self, number: int) -> Picture:
        """Return a frame of the clip on black."""
        row, frames = self.numbers.index(number), self.scene.frames
        return on_black(frames.images[row], frames.alphas[row])

    def front_camera(self, number: int) -> Camera:
        """Return the true camera of a frame."""
        return self.cameras[self.numbers.index(number)]


def find_scenes(paths: Sequence[Path]) -> tuple[Path, ...]:
    """Return the scenes among some folders and their subfolders.

    Raises:
        InputError: If a folder neither is nor holds a scene with truth, or two have one name.
    """
    found: list[Path] = []
    for path in paths:
        folders = [path] if _is_scene(path) else sorted(filter(_is_scene, _subfolders(path)))
        if not folders:
            raise InputError(
                f"{path}: expected a scene with truth, or a folder of such scenes: a folder with "
                f"{FRAMES_FOLDER}/ and {POINTS_FILE} or {PARTS_FILE}; docs/evaluation.md says more."
            )
        found += [folder for folder in folders if folder not in found]
    names = [scene_name(folder) for folder in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"Two scenes are called {name}; evaluate them apart.")
    return tuple(found)


def scene_name(folder: Path) -> str:
    """Return what a scene is called: its folder's name."""
    return folder.resolve().name


def read_truth_scene(folder: Path, renderer: Renderer) -> TruthScene:
    """Read a scene, its truth and its held-out cameras.

    Args:
        folder: The scene.
        renderer: Finds out what is seen where the truth does not say.

    Raises:
        InputError: If a part of it is missing or cannot be used.
    """
    scene = read_scene(discover(folder / FRAMES_FOLDER))
    if scene.frame_cameras is None:
        raise InputError(
            f"{folder}: expected the clip's true camera, transforms_frames.json, found none; depth "
            "and the figures of the clip's own view cannot be told without."
        )
    cameras = scene.frame_cameras
    if len(cameras) == 1:
        cameras = cameras * len(scene.frames)
    gaussians = scene.gaussians.to(renderer.device)
    return TruthScene(
        name=scene_name(folder),
        folder=folder,
        scene=scene,
        cameras=cameras,
        truth=read_truth(folder, gaussians, cameras, renderer),
        held_out=read_held_out_views(folder),
    )


def _is_scene(folder: Path) -> bool:
    has_truth = any((folder / name).is_file() for name in (POINTS_FILE, PARTS_FILE))
    return has_truth and (folder / FRAMES_FOLDER).is_dir()


def _subfolders(path: Path) -> list[Path]:
    try:
        return [entry for entry in path.iterdir() if entry.is_dir()]
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}.") from error
