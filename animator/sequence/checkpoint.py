"""The frames solved so far, on disk, so that an interrupted run can go on.

An `.npz` without pickle: poses and cameras exactly, so that a resumed run gives the same bytes as
an unbroken one; group labels as 16-bit differences from frame to frame, which compress to little.
"""

import dataclasses
import hashlib
import json
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from animator.errors import InputError
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.types import AnchorPoses, AnchorUncertainty, Camera, RigidGroups

FORMAT_NAME = "splatimate-progress"
FORMAT_VERSION = 2


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Checkpoint:
    """Frames 0..k-1 of one clip, and what they were solved from."""

    fingerprint: str
    """Equal for two runs exactly if one may continue the other."""
    solved: tuple[SolvedFrame, ...]
    """The frames, at least one."""


def fingerprint_of(*inputs: Any) -> str:
    """Digest everything a result depends on.

    Args:
        inputs: Dataclasses, mappings, sequences, arrays, tensors, texts, numbers and paths, nested.

    Returns:
        A SHA-256 in hex. Arrays count by type, shape and content, dataclasses by name and fields.
    """
    digest = hashlib.sha256()
    for chunk in _chunks(inputs):
        # Lengths before contents, so that no two different inputs run together to the same bytes.
        digest.update(len(chunk).to_bytes(8, "little"))
        digest.update(chunk)
    return digest.hexdigest()


def write_checkpoint(checkpoint: Checkpoint, path: Path) -> None:
    """Write a checkpoint to a file, in place: replacing the old one whole is for the caller."""
    solved = checkpoint.solved
    metadata = {
        "format": FORMAT_NAME,
        "version": FORMAT_VERSION,
        "fingerprint": checkpoint.fingerprint,
        "cameras": [_camera_fields(frame.camera) for frame in solved],
        "stats": [dataclasses.asdict(frame.stats) for frame in solved],
    }
    arrays = {
        "metadata": np.frombuffer(json.dumps(metadata).encode(), np.uint8),
        "quats_wxyz": np.stack([_array(frame.poses.quats_wxyz) for frame in solved]),
        "translations": np.stack([_array(frame.poses.translations) for frame in solved]),
        "cam_from_world": np.stack([frame.camera.cam_from_world for frame in solved]),
        "intrinsics": np.stack([frame.camera.intrinsics for frame in solved]),
        "label_steps": _label_steps([frame.groups.labels for frame in solved]),
        "deviations": np.stack([_deviations(frame) for frame in solved]),
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)


def read_checkpoint(path: Path, *, device: torch.device | str = "cpu") -> Checkpoint:
    """Read a checkpoint.

    Args:
        path: A file of `write_checkpoint`.
        device: Where the poses shall live.

    Raises:
        InputError: If it is missing, damaged, or of another version.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        metadata = json.loads(arrays["metadata"].tobytes())
        if (metadata["format"], metadata["version"]) != (FORMAT_NAME, FORMAT_VERSION):
            raise InputError(
                f"{path}: expected {FORMAT_NAME} {FORMAT_VERSION}, found {metadata['format']} "
                f"{metadata['version']}; run without --resume to start over."
            )
        return Checkpoint(
            fingerprint=metadata["fingerprint"], solved=_solved(metadata, arrays, device)
        )
    except InputError:
        raise
    except OSError as error:
        raise InputError(
            f"{path}: --resume cannot read it: {error.strerror or error}; "
            "run without --resume to start over."
        ) from error
    except (ValueError, KeyError, TypeError, zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise InputError(
            f"{path}: expected the progress of an interrupted run, found a damaged file ({error}); "
            "run without --resume to start over."
        ) from error


def _solved(
    metadata: dict[str, Any], arrays: dict[str, np.ndarray], device: torch.device | str
) -> tuple[SolvedFrame, ...]:
    labels = np.cumsum(arrays["label_steps"], axis=0, dtype=np.int64)
    solved = []
    for index, (camera, stats) in enumerate(
        zip(metadata["cameras"], metadata["stats"], strict=True)
    ):
        poses = AnchorPoses(
            quats_wxyz=torch.as_tensor(arrays["quats_wxyz"][index], device=device),
            translations=torch.as_tensor(arrays["translations"][index], device=device),
        )
        solved.append(
            SolvedFrame(
                poses=poses,
                camera=Camera(
                    cam_from_world=arrays["cam_from_world"][index],
                    intrinsics=arrays["intrinsics"][index],
                    **camera,
                ),
                groups=RigidGroups(labels=labels[index]),
                stats=FrameStats(**stats),
                uncertainty=_uncertainty(arrays["deviations"][index]),
            )
        )
    if not solved:
        raise ValueError("no frame in it")
    return tuple(solved)


def _camera_fields(camera: Camera) -> dict[str, Any]:
    return {"width_px": camera.width_px, "height_px": camera.height_px, "name": camera.name}


def _deviations(frame: SolvedFrame) -> np.ndarray:
    """Return along_ray and across_ray, float32, shape (2, A); NaN where they were not estimated."""
    if frame.uncertainty is None:
        return np.full((2, len(frame.poses.translations)), np.nan, np.float32)
    return np.stack([frame.uncertainty.along_ray, frame.uncertainty.across_ray])


def _uncertainty(deviations: np.ndarray) -> AnchorUncertainty | None:
    if np.isnan(deviations).any():
        return None
    along_ray, across_ray = deviations
    return AnchorUncertainty(along_ray=along_ray, across_ray=across_ray)


def _label_steps(labels: Sequence[np.ndarray]) -> np.ndarray:
    """Return each frame's labels less those of the frame before, int16 where they fit, (T, N)."""
    stacked = np.stack(labels)
    steps = np.diff(stacked, axis=0, prepend=np.zeros_like(stacked[:1]))
    limits = np.iinfo(np.int16)
    fits = limits.min <= steps.min(initial=0) and steps.max(initial=0) <= limits.max
    return steps.astype(np.int16 if fits else np.int64)


def _array(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().cpu().numpy()


def _chunks(value: Any) -> Iterator[bytes | memoryview]:
    """Take a nested value apart into typed bytes."""
    if isinstance(value, torch.Tensor):
        value = _array(value)
    if isinstance(value, np.ndarray):
        yield f"array {value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).reshape(-1).view(np.uint8).data
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield f"record {type(value).__name__}".encode()
        for field in dataclasses.fields(value):
            yield field.name.encode()
            yield from _chunks(getattr(value, field.name))
    elif isinstance(value, dict):
        yield f"mapping {len(value)}".encode()
        for key, item in value.items():
            yield from _chunks(key)
            yield from _chunks(item)
    elif isinstance(value, (tuple, list)):
        yield f"sequence {len(value)}".encode()
        for item in value:
            yield from _chunks(item)
    elif value is None or isinstance(value, str | int | float | Path):
        yield f"{type(value).__name__} {value!r}".encode()
    else:
        raise TypeError(f"cannot be fingerprinted: {type(value).__name__}")
