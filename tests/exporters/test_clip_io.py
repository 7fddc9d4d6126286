import dataclasses
import json
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.clip_io import FORMAT_VERSION, load_clip, save_clip
from exporters.errors import ClipError
from tests.helpers import clips

PARTS = ("splats", "rig", "skin", "tracks", "camera")


def assert_identical(first, second) -> None:
    for part_name in PARTS:
        first_part, second_part = getattr(first, part_name), getattr(second, part_name)
        assert (first_part is None) == (second_part is None)
        for field in dataclasses.fields(first_part) if first_part is not None else ():
            ours, theirs = getattr(first_part, field.name), getattr(second_part, field.name)
            if isinstance(ours, np.ndarray):
                assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape)
                assert ours.tobytes() == theirs.tobytes(), field.name
            else:
                assert ours == theirs
                assert type(ours) is type(theirs)
    for field in ("name", "fps", "up_axis", "meters_per_unit", "source_frames"):
        assert getattr(first, field) == getattr(second, field)


def rewritten(path, target, **metadata):
    """Copy a clip file with other metadata."""
    with np.load(path, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    old = json.loads(arrays["metadata"].tobytes())
    arrays["metadata"] = np.frombuffer(json.dumps(old | metadata).encode(), np.uint8)
    np.savez(target, **arrays)
    return target


@pytest.mark.parametrize("make", clips.ALL.values(), ids=clips.ALL.keys())
def test_round_trip_is_exact(make, tmp_path):
    clip = make()
    path = tmp_path / "clip.splatimate.npz"
    assert save_clip(clip, path) == (path,)
    assert_identical(clip, load_clip(path))


@settings(derandomize=True, max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 1000),
    degree=st.integers(0, 3),
    name=st.text(min_size=1).filter(str.strip),
    fps=st.floats(1e-3, 1e3),
)
def test_round_trip_of_any_name_and_number(tmp_path_factory, seed, degree, name, fps):
    clip = clips.random(seed=seed, sh_degree=degree)
    clip = dataclasses.replace(clip, name=name, fps=fps, meters_per_unit=np.float64(0.1))
    path = tmp_path_factory.mktemp("clip") / "c.splatimate.npz"
    save_clip(clip, path)
    assert_identical(clip, load_clip(path))


def test_same_clip_same_bytes_and_plain_numpy_reads_it(tmp_path):
    first, second = tmp_path / "a.splatimate.npz", tmp_path / "b.splatimate.npz"
    clip = clips.random()
    save_clip(clip, first)
    save_clip(clips.random(), second)
    assert first.read_bytes() == second.read_bytes()
    with np.load(first, allow_pickle=False) as archive:
        np.testing.assert_array_equal(archive["skin.weights"], clip.skin.weights)
        assert json.loads(archive["metadata"].tobytes())["format"] == "splatimate-clip"


def test_invalid_clip_is_not_written(tmp_path):
    with pytest.raises(ClipError, match="fps"):
        save_clip(dataclasses.replace(clips.hinge(), fps=0), tmp_path / "c.splatimate.npz")
    assert not list(tmp_path.iterdir())


def test_newer_version_says_upgrade(tmp_path):
    save_clip(clips.hinge(), tmp_path / "c.splatimate.npz")
    newer = rewritten(
        tmp_path / "c.splatimate.npz", tmp_path / "newer.npz", version=FORMAT_VERSION + 1
    )
    with pytest.raises(ClipError, match=rf"version {FORMAT_VERSION + 1}.*upgrade"):
        load_clip(newer)


def test_contents_are_validated(tmp_path):
    save_clip(clips.hinge(), tmp_path / "c.splatimate.npz")
    damaged = rewritten(tmp_path / "c.splatimate.npz", tmp_path / "damaged.npz", fps=-24.0)
    with pytest.raises(ClipError, match=r"(?s)damaged\.npz.*fps"):
        load_clip(damaged)


def test_missing_metadata_field_is_damage(tmp_path):
    save_clip(clips.hinge(), tmp_path / "c.splatimate.npz")
    damaged = rewritten(tmp_path / "c.splatimate.npz", tmp_path / "damaged.npz", rig={})
    with pytest.raises(ClipError, match="damaged clip"):
        load_clip(damaged)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.999])
def test_truncated_file(tmp_path, share):
    path = tmp_path / "c.splatimate.npz"
    save_clip(clips.random(), path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(ClipError, match=r"c\.splatimate\.npz.*cut off"):
        load_clip(path)


def test_a_flipped_bit_is_found(tmp_path):
    path = tmp_path / "c.splatimate.npz"
    save_clip(clips.random(), path)
    data = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        start = archive.getinfo("splats.scales.npy").header_offset
    data[start + 300] ^= 1
    path.write_bytes(bytes(data))
    with pytest.raises(ClipError, match="damaged clip"):
        load_clip(path)


def test_foreign_files(tmp_path):
    text, npz = tmp_path / "notes.txt", tmp_path / "other.npz"
    text.write_text("hello")
    np.savez(npz, a=np.zeros(3))
    with pytest.raises(ClipError, match=r"notes\.txt: not a clip"):
        load_clip(text)
    with pytest.raises(ClipError, match=r"other\.npz: not a clip.*without `metadata`"):
        load_clip(npz)
    with pytest.raises(ClipError, match=r"missing\.npz: cannot be read"):
        load_clip(tmp_path / "missing.npz")


def test_pickles_are_refused(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, metadata=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ClipError, match="damaged clip"):
        load_clip(path)
