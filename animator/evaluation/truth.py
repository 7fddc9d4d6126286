"""How a scene really moved: points of its surface, frame by frame.

Two forms are read; docs/evaluation.md documents them for those who write them.
"""

import dataclasses
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from animator.errors import InputError
from animator.render.protocol import Renderer
from animator.report.quality import SEEN_SHARE
from animator.types import Camera, Gaussians

POINTS_FILE = "gt_points.npz"
"""Points of the true surface, carried by the true motion."""
PARTS_FILE = "true_motion.npz"
"""Which rigid part each Gaussian belongs to, and how the parts moved."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Truth:
    """P points that follow the true motion over the T frames of the clip."""

    points: np.ndarray
    """Where they are [scene unit], frame 0 at rest, float64, shape (T, P, 3)."""
    is_seen: np.ndarray
    """Whether the clip's camera sees them, bool, shape (T, P)."""
    is_outer: np.ndarray
    """Whether they lie on the outside, where they count, bool, shape (P,)."""
    part_ids: np.ndarray
    """The part of each, -1 for none, int64, shape (P,)."""
    part_names: tuple[str, ...]
    """Names of the parts, by id."""
    has_rigid_parts: bool
    """Whether each part moves rigidly."""
    gaussian_ids: np.ndarray | None = None
    """The Gaussian that each point is the center of, int64, shape (P,); None for surface points,
    which ride on the Gaussians around them."""

    @property
    def diagonal(self) -> float:
        """Diagonal of the box around all points at rest [scene unit], the unit of errors."""
        return float(np.linalg.norm(np.ptp(self.points[0], axis=0)))


def read_truth(
    folder: Path, gaussians: Gaussians, cameras: Sequence[Camera], renderer: Renderer
) -> Truth:
    """Read the truth of a scene.

    Args:
        folder: The scene.
        gaussians: Its splat at rest, on the renderer's device.
        cameras: The clip's true camera at each of its T frames.
        renderer: Finds out what is seen where the file does not say.

    Raises:
        InputError: If there is none, or it does not fit the clip or the splat.
    """
    if (folder / POINTS_FILE).is_file():
        truth = _read_points(folder / POINTS_FILE)
        where = folder / POINTS_FILE
    elif (folder / PARTS_FILE).is_file():
        where = folder / PARTS_FILE
        truth = _read_parts(where, gaussians, cameras, renderer)
    else:
        raise InputError(
            f"{folder}: expected a scene with truth, {POINTS_FILE} or {PARTS_FILE}, found neither; "
            "docs/evaluation.md says what they hold."
        )
    if len(truth.points) != len(cameras):
        raise InputError(
            f"{where}: expected the truth of the {len(cameras)} frames of the clip, found that of "
            f"{len(truth.points)}; do the file and the frames belong together?"
        )
    return truth


def _read_points(path: Path) -> Truth:
    """Read `gt_points.npz`: surface points."""
    wanted = ("points", "point_visible")
    optional = ("point_train_views", "point_part", "part_group", "part_names")
    arrays = _read_arrays(path, wanted, optional)
    points = arrays["points"].astype(np.float64)
    if points.ndim != 3 or points.shape[2] != 3 or points.size == 0:
        raise InputError(f"{path}: points: expected shape (T, P, 3), found {points.shape}.")
    if not np.isfinite(points).all():
        raise InputError(f"{path}: points: expected finite positions, found NaN or Inf.")
    frame_count, count = points.shape[:2]
    _check_shape(path, arrays, "point_visible", (frame_count, count))
    _check_shape(path, arrays, "point_train_views", (count,))
    _check_shape(path, arrays, "point_part", (count,))
    is_outer = np.ones(count, bool)
    if "point_train_views" in arrays:
        is_outer = arrays["point_train_views"] > 0
    part_ids, names = _groups_of_parts(path, arrays, count)
    return Truth(
        points=points,
        is_seen=arrays["point_visible"].astype(bool),
        is_outer=is_outer,
        part_ids=part_ids,
        part_names=names,
        has_rigid_parts="part_group" in arrays and bool((part_ids >= 0).all()),
    )


def _groups_of_parts(
    path: Path, arrays: Mapping[str, np.ndarray], count: int
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the group of each point, and what to call the groups: after their largest part."""
    if "point_part" not in arrays:
        return np.full(count, -1), ()
    parts = arrays["point_part"].astype(np.int64)
    part_count = int(parts.max(initial=-1)) + 1
    groups = arrays.get("part_group", np.arange(part_count)).astype(np.int64)
    if len(groups) < part_count or (len(groups) and groups.min() < 0):
        raise InputError(
            f"{path}: part_group: expected the group, from 0, of each of {part_count} parts, found "
            f"{len(groups)} entries."
        )
    names = [str(name) for name in arrays.get("part_names", ())]
    names += [f"part {k}" for k in range(len(names), part_count)]
    sizes = np.bincount(parts[parts >= 0], minlength=len(groups))
    titles = []
    for group in range(int(groups.max(initial=-1)) + 1):
        members = np.flatnonzero((groups == group) & (sizes > 0))
        largest = members[np.argmax(sizes[members])] if len(members) else -1
        more = f" and {len(members) - 1} more" if len(members) > 1 else ""
        titles.append(f"{names[largest]}{more}" if len(members) else f"group {group}")
    return np.where(parts >= 0, groups[parts] if len(groups) else -1, -1), tuple(titles)


def _read_parts(
    path: Path, gaussians: Gaussians, cameras: Sequence[Camera], renderer: Renderer
) -> Truth:
    """Read `true_motion.npz`: every Gaussian is a point, and moves with its part."""
    arrays = _read_arrays(path, ("part_ids", "posed_from_rest"), ("part_names",))
    part_ids, motions = arrays["part_ids"].astype(np.int64), arrays["posed_from_rest"]
    if motions.ndim != 4 or motions.shape[2:] != (4, 4) or motions.size == 0:
        raise InputError(
            f"{path}: posed_from_rest: expected shape (T, parts, 4, 4), found {motions.shape}."
        )
    if not np.isfinite(motions).all():
        raise InputError(f"{path}: posed_from_rest: expected finite numbers, found NaN or Inf.")
    _check_shape(path, arrays, "part_ids", (len(gaussians),))
    part_count = motions.shape[1]
    if part_ids.min() < 0 or part_ids.max() >= part_count:
        raise InputError(f"{path}: part_ids: expected parts 0 to {part_count - 1}, found others.")
    rest = gaussians.means.detach().cpu().numpy().astype(np.float64)
    by_point = motions[:, part_ids].astype(np.float64)
    points = np.einsum("tpij,pj->tpi", by_point[..., :3, :3], rest) + by_point[..., :3, 3]
    names = [str(name) for name in arrays.get("part_names", ())]
    names += [f"part {k}" for k in range(len(names), part_count)]
    is_seen = [
        _is_seen(gaussians, frame_points, camera, renderer)
        for frame_points, camera in zip(points, cameras, strict=False)
    ]
    return Truth(
        points=points,
        is_seen=np.stack(is_seen),
        is_outer=np.ones(len(part_ids), bool),
        part_ids=part_ids,
        part_names=tuple(names),
        has_rigid_parts=True,
        gaussian_ids=np.arange(len(part_ids)),
    )


def _is_seen(
    gaussians: Gaussians, points: np.ndarray, camera: Camera, renderer: Renderer
) -> np.ndarray:
    """Find out which Gaussians, moved to their true places, reach the camera."""
    means = gaussians.means.new_tensor(points)
    seen = renderer.visibility(gaussians.posed(means, gaussians.quats_wxyz), camera)
    return seen.visible_shares > SEEN_SHARE


def _read_arrays(
    path: Path, wanted: Sequence[str], optional: Sequence[str]
) -> dict[str, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            missing = [name for name in wanted if name not in archive.files]
            if missing:
                raise InputError(
                    f"{path}: expected the arrays {', '.join(wanted)}, found no "
                    f"{', '.join(missing)}; docs/evaluation.md says what they hold."
                )
            names = (*wanted, *(name for name in optional if name in archive.files))
            return {name: archive[name] for name in names}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: expected an .npz of arrays, cannot be read: {error}.") from error


def _check_shape(
    path: Path, arrays: Mapping[str, np.ndarray], name: str, shape: tuple[int, ...]
) -> None:
    if name in arrays and arrays[name].shape != shape:
        raise InputError(f"{path}: {name}: expected shape {shape}, found {arrays[name].shape}.")
