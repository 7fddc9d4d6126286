"""What a method found: where every Gaussian is, frame by frame."""

import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from animator.errors import InputError
from animator.scene import read_ply
from animator.types import Gaussians
from exporters.clip import Clip
from exporters.clip_io import SUFFIX, load_clip


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """The poses of N Gaussians at some frames."""

    gaussians: Gaussians
    """At rest, on the CPU."""
    numbers: tuple[int, ...]
    """Number of the frame of each pose, increasing, length T."""
    positions: np.ndarray
    """Centers [scene unit], float32, shape (T, N, 3)."""
    quats_wxyz: np.ndarray
    """Unit rotations, float32, shape (T, N, 4)."""

    def __len__(self) -> int:
        return len(self.numbers)

    def posed(self, index: int) -> Gaussians:
        """Return the Gaussians at one of the poses."""
        means = torch.from_numpy(self.positions[index])
        return self.gaussians.posed(means, torch.from_numpy(self.quats_wxyz[index]))

    def first_gaussians(self, count: int) -> "Motion":
        """Return the motion of the first Gaussians only."""
        fields = dataclasses.fields(self.gaussians)
        kept = {field.name: getattr(self.gaussians, field.name)[:count] for field in fields}
        return dataclasses.replace(
            self,
            gaussians=Gaussians(**kept),
            positions=np.ascontiguousarray(self.positions[:, :count]),
            quats_wxyz=np.ascontiguousarray(self.quats_wxyz[:, :count]),
        )

    def take(self, numbers: Sequence[int]) -> "Motion":
        """Return the poses at some of the frames."""
        rows = [self.numbers.index(number) for number in numbers]
        return dataclasses.replace(
            self,
            numbers=tuple(numbers),
            positions=self.positions[rows],
            quats_wxyz=self.quats_wxyz[rows],
        )


def motion_at_rest(gaussians: Gaussians, numbers: Sequence[int]) -> Motion:
    """Return the floor to beat: the rest pose at every frame."""
    count = len(numbers)
    means, quats = gaussians.means.cpu().numpy(), gaussians.quats_wxyz.cpu().numpy()
    return Motion(
        gaussians=gaussians.to(torch.device("cpu")),
        numbers=tuple(numbers),
        positions=np.tile(means, (count, 1, 1)),
        quats_wxyz=np.tile(quats, (count, 1, 1)),
    )


def motion_of_clip(clip: Clip, moments: Sequence[tuple[int, float]] | None = None) -> Motion:
    """Pose a clip.

    Args:
        clip: The clip.
        moments: Frame numbers with the times [s] to pose them at; None for the solved keys.
    """
    if moments is None:
        numbers = clip.source_frames or tuple(range(len(clip.tracks)))
        keys = zip(numbers, clip.tracks.times_s, strict=True)
        moments = [(number, float(time_s)) for number, time_s in keys if number >= 0]
    posed = [clip.pose_at(time_s) for _, time_s in moments]
    splats = clip.splats
    return Motion(
        gaussians=Gaussians(
            means=torch.tensor(splats.positions),
            quats_wxyz=torch.tensor(splats.quats_wxyz),
            scales=torch.tensor(splats.scales),
            opacities=torch.tensor(splats.opacities),
            sh_coeffs=torch.tensor(splats.sh_coeffs),
        ),
        numbers=tuple(number for number, _ in moments),
        positions=np.stack([pose.positions for pose in posed]),
        quats_wxyz=np.stack([pose.quats_wxyz for pose in posed]),
    )


def read_motion(path: Path, frame_numbers: Sequence[int]) -> tuple[Motion, Clip | None]:
    """Read a result that is there already, ours or that of another program.

    Args:
        path: A `.splatimate.npz`, or a folder of one INRIA PLY a frame, Gaussian i the same in all,
            whose names sort into frame order.
        frame_numbers: The frames that the files of such a folder show.

    Returns:
        The motion, and the clip it is read from if it is one.

    Raises:
        InputError: If there is nothing, or it does not fit the frames.
        exporters.errors.ClipError: If the clip is damaged.
    """
    if path.is_dir():
        return _read_ply_folder(path, frame_numbers), None
    if not path.is_file():
        raise InputError(
            f"{path}: there is no such clip; --clip expects a {SUFFIX} file or a folder of one PLY "
            "a frame."
        )
    clip = load_clip(path)
    motion = motion_of_clip(clip)
    foreign = sorted(set(motion.numbers) - set(frame_numbers))
    if foreign:
        raise InputError(
            f"{path}: expected a clip of frames {frame_numbers[0]} to {frame_numbers[-1]}, found "
            f"frame {foreign[0]}; is it a clip of another scene?"
        )
    return motion, clip


def _read_ply_folder(folder: Path, frame_numbers: Sequence[int]) -> Motion:
    paths = sorted(folder.glob("*.ply"), key=_natural)
    if len(paths) != len(frame_numbers):
        raise InputError(
            f"{folder}: expected {len(frame_numbers)} PLY files, one a frame, found {len(paths)}; "
            "where not every frame was animated, say which with --frames."
        )
    rest = read_ply(paths[0])
    posed = [rest, *(read_ply(path) for path in paths[1:])]
    for path, gaussians in zip(paths, posed, strict=True):
        if len(gaussians) != len(rest):
            raise InputError(
                f"{path}: expected {len(rest):,} Gaussians as in {paths[0].name}, found "
                f"{len(gaussians):,}; Gaussian i must be the same in all files."
            )
    return Motion(
        gaussians=rest,
        numbers=tuple(frame_numbers),
        positions=np.stack([gaussians.means.numpy() for gaussians in posed]),
        quats_wxyz=np.stack([gaussians.quats_wxyz.numpy() for gaussians in posed]),
    )


def _natural(path: Path) -> tuple[int, str]:
    digits = re.findall(r"\d+", path.stem)
    return (int(digits[-1]) if digits else -1, path.name)
