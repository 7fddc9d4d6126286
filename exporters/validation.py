"""Every way in which a clip can break its contract, in words."""

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from exporters.clip import Clip, ClipCamera, Rig, Skin, Splats, Tracks, Uncertainty

UNIT_TOLERANCE = 1e-4  # of a quaternion's norm: float32 input normalized by anyone passes
WEIGHT_SUM_TOLERANCE = 1e-4
ORTHONORMAL_TOLERANCE = 1e-4
SH_COUNTS = (1, 4, 9, 16)


def find_problems(clip: Clip) -> list[str]:
    """Return all problems of a clip, each naming the field, what is expected and what was found.

    Problems of values are looked for only where the shapes are right.
    """
    problems = [*_clip_problems(clip)]
    shape_problems = [*_shape_problems(clip)]
    if shape_problems:
        return problems + shape_problems
    problems += _splat_problems(clip.splats)
    problems += _rig_problems(clip.rig)
    problems += _skin_problems(clip.skin, len(clip.rig))
    problems += _track_problems(clip.tracks)
    if clip.camera is not None:
        problems += _camera_problems(clip.camera)
    if clip.uncertainty is not None:
        problems += _uncertainty_problems(clip.uncertainty)
    return problems


def _clip_problems(clip: Clip) -> Iterator[str]:
    if not clip.name.strip():
        yield "name: expected some text, got an empty name"
    if not (np.isfinite(clip.fps) and clip.fps > 0):
        yield f"fps: expected a positive number, got {clip.fps}"
    if not (np.isfinite(clip.meters_per_unit) and clip.meters_per_unit > 0):
        yield f"meters_per_unit: expected a positive number, got {clip.meters_per_unit}"
    if clip.up_axis not in ("Y", "Z"):
        yield f"up_axis: expected 'Y' or 'Z', got {clip.up_axis!r}"
    key_count = clip.tracks.times_s.size
    if len(clip.source_frames) not in (0, key_count):
        yield (
            f"source_frames: expected 0 or {key_count} numbers, one a key, "
            f"got {len(clip.source_frames)}"
        )


def _shape_problems(clip: Clip) -> Iterator[str]:
    splats, rig, tracks = clip.splats, clip.rig, clip.tracks
    splat_count, joint_count = splats.positions.shape[0] if splats.positions.ndim else 0, len(rig)
    key_count = tracks.times_s.shape[0] if tracks.times_s.ndim else 0
    if splat_count == 0:
        yield "splats.positions: expected shape (N, 3) with N >= 1, got no Gaussian"
    if joint_count == 0:
        yield "rig.joint_names: expected at least one joint, the shape of all others follows it"
    if key_count == 0:
        yield "tracks.times_s: expected shape (T,) with T >= 1, got no key"
    sh_shape = splats.sh_coeffs.shape
    sh_count = sh_shape[1] if len(sh_shape) == 3 else SH_COUNTS[0]
    if sh_count not in SH_COUNTS:
        yield f"splats.sh_coeffs: expected shape (N, K, 3) with K in {SH_COUNTS}, got {sh_shape}"
    expected_shapes = {
        "splats.positions": (splats.positions, (splat_count, 3)),
        "splats.quats_wxyz": (splats.quats_wxyz, (splat_count, 4)),
        "splats.scales": (splats.scales, (splat_count, 3)),
        "splats.opacities": (splats.opacities, (splat_count,)),
        "splats.sh_coeffs": (splats.sh_coeffs, (splat_count, sh_count, 3)),
        "rig.parents": (rig.parents, (joint_count,)),
        "rig.rest_translations": (rig.rest_translations, (joint_count, 3)),
        "rig.rest_quats_wxyz": (rig.rest_quats_wxyz, (joint_count, 4)),
        "rig.part_ids": (rig.part_ids, (joint_count,)),
        "skin.joint_ids": (clip.skin.joint_ids, (splat_count, 4)),
        "skin.weights": (clip.skin.weights, (splat_count, 4)),
        "tracks.times_s": (tracks.times_s, (key_count,)),
        "tracks.translations": (tracks.translations, (key_count, joint_count, 3)),
        "tracks.quats_wxyz": (tracks.quats_wxyz, (key_count, joint_count, 4)),
    }
    if clip.uncertainty is not None:
        for field, array in vars(clip.uncertainty).items():
            expected_shapes[f"uncertainty.{field}"] = (array, (key_count, joint_count))
    for name, (array, expected) in expected_shapes.items():
        if array.shape != expected:
            yield f"{name}: expected shape {expected}, got {array.shape}"
    if clip.camera is not None:
        yield from _camera_shape_problems(clip.camera, key_count)


def _camera_shape_problems(camera: ClipCamera, key_count: int) -> Iterator[str]:
    shape = camera.cam_from_world.shape
    if shape not in ((1, 4, 4), (key_count, 4, 4)):
        yield (
            f"camera.cam_from_world: expected shape (1, 4, 4) or ({key_count}, 4, 4), got {shape}"
        )
    if camera.intrinsics.shape != (3, 3):
        yield f"camera.intrinsics: expected shape (3, 3), got {camera.intrinsics.shape}"


def _splat_problems(splats: Splats) -> Iterator[str]:
    for field in ("positions", "quats_wxyz", "scales", "opacities", "sh_coeffs"):
        yield from _finite_problems(f"splats.{field}", getattr(splats, field))
    yield from _unit_problems("splats.quats_wxyz", splats.quats_wxyz)
    yield from _count_problems(
        "splats.scales", ~(splats.scales.T > 0).all(axis=0), "Gaussians with a scale <= 0"
    )
    outside = ~((splats.opacities >= 0) & (splats.opacities <= 1))
    yield from _count_problems(
        "splats.opacities", outside, "Gaussians outside 0..1; are these logits?"
    )


def _rig_problems(rig: Rig) -> Iterator[str]:
    for field in ("rest_translations", "rest_quats_wxyz"):
        yield from _finite_problems(f"rig.{field}", getattr(rig, field))
    yield from _unit_problems("rig.rest_quats_wxyz", rig.rest_quats_wxyz)
    if any(not name.strip() for name in rig.joint_names):
        yield "rig.joint_names: expected non-empty names"
    repeated = sorted({name for name in rig.joint_names if rig.joint_names.count(name) > 1})
    if repeated:
        yield f"rig.joint_names: expected unique names, found more than once: {repeated[:5]}"
    roots = np.flatnonzero(rig.parents < 0)
    if not np.array_equal(roots, [0]) or rig.parents[0] != -1:
        yield (
            "rig.parents: expected exactly one root, joint 0 with parent -1, "
            f"found parents < 0 at joints {roots[:5].tolist()}"
        )
    late = np.flatnonzero(rig.parents >= np.arange(len(rig)))
    if len(late):
        yield f"rig.parents: expected parents before children, not so at joints {late[:5].tolist()}"


def _skin_problems(skin: Skin, joint_count: int) -> Iterator[str]:
    # One row an influence: numpy is slow on short rows.
    joint_ids = np.ascontiguousarray(skin.joint_ids.T)
    weights = np.ascontiguousarray(skin.weights.T)
    yield from _finite_problems("skin.weights", skin.weights)
    outside = ((joint_ids < 0) | (joint_ids >= joint_count)).any(axis=0)
    yield from _count_problems(
        "skin.joint_ids", outside, f"Gaussians with a joint outside 0..{joint_count - 1}"
    )
    yield from _count_problems(
        "skin.weights", (weights < 0).any(axis=0), "Gaussians with a negative weight"
    )
    sums = weights.sum(axis=0, dtype=np.float64)
    yield from _count_problems(
        "skin.weights",
        np.abs(sums - 1) > WEIGHT_SUM_TOLERANCE,
        "Gaussians whose weights do not sum to 1",
    )
    # An unused influence gets an id of its own, below 0, so that only used ones can be equal.
    used = np.where(weights > 0, joint_ids, -1 - np.arange(len(joint_ids))[:, None])
    repeated = [(one == other) & (one >= 0) for one, other in itertools.combinations(used, 2)]
    yield from _count_problems(
        "skin.joint_ids",
        np.any(repeated, axis=0),
        "Gaussians that follow one joint twice; add the two weights (Blender keeps only the last)",
    )


def _track_problems(tracks: Tracks) -> Iterator[str]:
    for field in ("times_s", "translations", "quats_wxyz"):
        yield from _finite_problems(f"tracks.{field}", getattr(tracks, field))
    yield from _unit_problems("tracks.quats_wxyz", tracks.quats_wxyz)
    if tracks.times_s[0] != 0:
        yield f"tracks.times_s: expected the first key at 0 s, got {tracks.times_s[0]}"
    yield from _count_problems(
        "tracks.times_s", ~(np.diff(tracks.times_s) > 0), "keys not later than the one before"
    )
    cosines = np.einsum("tji,tji->tj", tracks.quats_wxyz[1:], tracks.quats_wxyz[:-1])
    yield from _count_problems(
        "tracks.quats_wxyz",
        cosines < 0,
        "sign jumps between neighboring keys; pass them through keyframes.continue_signs",
    )


def _camera_problems(camera: ClipCamera) -> Iterator[str]:
    yield from _finite_problems("camera.cam_from_world", camera.cam_from_world)
    yield from _finite_problems("camera.intrinsics", camera.intrinsics)
    if camera.width_px <= 0 or camera.height_px <= 0:
        yield (
            "camera: expected width_px and height_px > 0, "
            f"got {camera.width_px} x {camera.height_px}"
        )
    if not (camera.intrinsics[0, 0] > 0 and camera.intrinsics[1, 1] > 0):
        yield "camera.intrinsics: expected positive focal lengths at [0, 0] and [1, 1]"
    if not np.array_equal(camera.intrinsics[2], [0, 0, 1]):
        yield f"camera.intrinsics: expected the last row 0 0 1, got {camera.intrinsics[2]}"
    rotations = camera.cam_from_world[:, :3, :3]
    errors = np.abs(rotations @ rotations.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
    is_rigid = (errors <= ORTHONORMAL_TOLERANCE) & (np.linalg.det(rotations) > 0)
    is_rigid &= (camera.cam_from_world[:, 3] == [0, 0, 0, 1]).all(axis=1)
    yield from _count_problems(
        "camera.cam_from_world", ~is_rigid, "poses that are not rigid; expected rotation | t"
    )


def _uncertainty_problems(uncertainty: Uncertainty) -> Iterator[str]:
    for field, array in vars(uncertainty).items():
        yield from _finite_problems(f"uncertainty.{field}", array)
        yield from _count_problems(f"uncertainty.{field}", array < 0, "standard deviations below 0")


def _finite_problems(name: str, array: np.ndarray) -> Iterator[str]:
    yield from _count_problems(name, ~np.isfinite(array), "numbers that are not finite")


def _unit_problems(name: str, quats_wxyz: np.ndarray) -> Iterator[str]:
    norms = np.sqrt(np.einsum("...i,...i->...", quats_wxyz, quats_wxyz))
    yield from _count_problems(
        name, ~(np.abs(norms - 1) <= UNIT_TOLERANCE), "quaternions that are not of unit length"
    )


def _count_problems(name: str, is_bad: ArrayLike, what: str) -> Iterator[str]:
    """Yield one line if any entry is bad, with the count and the first index."""
    is_bad = np.asarray(is_bad)
    count = int(np.count_nonzero(is_bad))
    if count:
        first = tuple(int(axis[0]) for axis in np.nonzero(is_bad))
        index = first[0] if len(first) == 1 else first
        yield f"{name}: {count} {what} (first at {index})"
