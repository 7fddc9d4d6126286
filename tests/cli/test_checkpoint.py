import dataclasses
import zipfile

import numpy as np
import pytest
import torch

from animator.errors import InputError
from animator.sequence.checkpoint import (
    Checkpoint,
    fingerprint_of,
    read_checkpoint,
    write_checkpoint,
)
from animator.sequence.solved_frame import FrameStats, SolvedFrame
from animator.types import AnchorPoses, AnchorUncertainty, Camera, RigidGroups


def solved_frame(seed: int, *, gaussians: int = 50, groups: int = 5) -> SolvedFrame:
    rng = np.random.default_rng(seed)
    return SolvedFrame(
        poses=AnchorPoses(
            quats_wxyz=torch.as_tensor(rng.normal(size=(7, 4)), dtype=torch.float32),
            translations=torch.as_tensor(rng.normal(size=(7, 3)), dtype=torch.float32),
        ),
        camera=Camera(
            cam_from_world=rng.normal(size=(4, 4)),
            intrinsics=rng.normal(size=(3, 3)),
            width_px=640,
            height_px=480,
            name=f"view_{seed}.png",
        ),
        groups=RigidGroups(labels=rng.integers(-1, groups, gaussians)),
        stats=FrameStats(
            matches=seed,
            reprojection_px=float("nan") if seed == 0 else rng.normal(),
            start="previous",
            groups=groups,
            seconds={"match": 0.25, "image stage": rng.random()},
        ),
        uncertainty=None
        if seed == 0
        else AnchorUncertainty(
            along_ray=rng.random(7, np.float32), across_ray=rng.random(7, np.float32)
        ),
    )


def checkpoint_of(count: int, **options) -> Checkpoint:
    frames = tuple(solved_frame(seed, **options) for seed in range(count))
    return Checkpoint(fingerprint="abc", solved=frames)


@pytest.mark.parametrize("groups", [5, 40_000])
def test_a_round_trip_changes_no_bit(tmp_path, groups):
    before = checkpoint_of(3, groups=groups)
    write_checkpoint(before, tmp_path / "p.npz")
    after = read_checkpoint(tmp_path / "p.npz")
    assert after.fingerprint == "abc"
    # The digest covers every field of every frame, arrays bit for bit.
    assert fingerprint_of(after.solved) == fingerprint_of(before.solved)
    assert after.solved[2].groups.labels.dtype == np.int64


def test_the_file_of_a_long_clip_stays_small(tmp_path):
    still = solved_frame(1, gaussians=100_000)
    write_checkpoint(Checkpoint(fingerprint="", solved=(still,) * 40), tmp_path / "p.npz")
    # 8 MB of 16-bit labels that do not change from frame to frame.
    assert (tmp_path / "p.npz").stat().st_size < 400_000


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.unlink(),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(path.read_bytes()[:-40]),
        lambda path: path.write_bytes(b"PK" + path.read_bytes()[2:1000]),
        lambda path: np.savez(path, metadata=np.zeros(3, np.uint8)),
        lambda path: np.savez(path, metadata=np.array({"a": 1}, dtype=object)),
    ],
)
def test_damaged_files_are_explained(tmp_path, spoil):
    path = tmp_path / "p.npz"
    write_checkpoint(checkpoint_of(2), path)
    spoil(path)
    with pytest.raises(InputError, match=r"p\.npz.*--resume"):
        read_checkpoint(path)


def test_a_newer_format_is_refused(tmp_path):
    path = tmp_path / "p.npz"
    write_checkpoint(checkpoint_of(1), path)
    with np.load(path) as archive:
        arrays = dict(archive)
    metadata = arrays["metadata"].tobytes().replace(b'"version": 2', b'"version": 3')
    np.savez(path, **{**arrays, "metadata": np.frombuffer(metadata, np.uint8)})
    with pytest.raises(InputError, match="splatimate-progress 3"):
        read_checkpoint(path)


def test_nothing_in_the_file_needs_pickle(tmp_path):
    write_checkpoint(checkpoint_of(2), tmp_path / "p.npz")
    with zipfile.ZipFile(tmp_path / "p.npz") as archive:
        for name in archive.namelist():
            with archive.open(name) as stream:
                np.lib.format.read_array(stream, allow_pickle=False)


@dataclasses.dataclass(frozen=True)
class Pair:
    first: object
    second: object


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Pair("ab", "c"), Pair("a", "bc")),
        (Pair(None, 1), Pair(1, None)),
        (1, 1.0),
        (1, True),
        (1, "1"),
        ((1, 2), ((1,), 2)),
        (np.zeros(4), np.zeros((2, 2))),
        (np.zeros(2, np.float32), np.zeros(2, np.int32)),
        (np.array([0.0]), np.array([-0.0])),
        ({"a": 1}, {"b": 1}),
        ((), None),
    ],
)
def test_different_inputs_have_different_fingerprints(one, other):
    assert fingerprint_of(one) != fingerprint_of(other)


def test_fingerprints_ignore_memory_layout():
    array = np.arange(12.0).reshape(3, 4)
    assert fingerprint_of(array.T) == fingerprint_of(np.ascontiguousarray(array.T))
    assert fingerprint_of(torch.as_tensor(array)) == fingerprint_of(array)


def test_a_known_fingerprint_does_not_change():
    # SHA-256 over (8-byte little-endian length, bytes) of b"sequence 1" and b"int 7", by hashlib.
    import hashlib

    chunks = (b"sequence 1", b"int 7")
    expected = hashlib.sha256(b"".join(len(c).to_bytes(8, "little") + c for c in chunks))
    assert fingerprint_of(7) == expected.hexdigest()


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(TypeError):
        fingerprint_of(object())
