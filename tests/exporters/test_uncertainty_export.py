"""What is known of the joints' uncertainty survives in every format that has a place for it."""

import dataclasses
import json
import re

import numpy as np
import pytest

from exporters.clip import Uncertainty
from exporters.clip_io import load_clip, save_clip
from exporters.coordinates import to_y_up_meters
from exporters.errors import ClipError
from exporters.gltf.write import write_gltf
from exporters.joint_limit import within_limit
from exporters.options import ExportOptions
from exporters.usd.write import write_usd_rig
from tests.helpers import clips, gltf_reader

FIELDS = ("along_ray", "across_ray")
USD_NAMES = {name: f"splatimate:uncertainty:{name[:-4]}Ray" for name in FIELDS}


def spoiled(**fields: np.ndarray):
    clip = clips.observed(clips.chain())
    changed = dataclasses.replace(clip.uncertainty, **fields)
    return dataclasses.replace(clip, uncertainty=changed)


def usd_animation(path):
    from pxr import Usd, UsdSkel

    stage = Usd.Stage.Open(str(path))
    (animation,) = [prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Animation)]
    return stage, animation


def test_the_clip_file_keeps_it_bit_for_bit(tmp_path):
    clip = clips.observed(clips.random())
    save_clip(clip, tmp_path / "c.splatimate.npz")
    loaded = load_clip(tmp_path / "c.splatimate.npz").uncertainty
    for field in FIELDS:
        ours, theirs = getattr(clip.uncertainty, field), getattr(loaded, field)
        assert (theirs.dtype, theirs.shape) == (np.float32, ours.shape)
        assert theirs.tobytes() == ours.tobytes()


def test_files_written_before_it_existed_are_read(tmp_path):
    path, old = tmp_path / "c.splatimate.npz", tmp_path / "old.splatimate.npz"
    save_clip(clips.chain(), path)
    with np.load(path, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    metadata = json.loads(arrays["metadata"].tobytes())
    assert metadata["version"] == 1
    assert metadata.pop("uncertainty") is None
    arrays["metadata"] = np.frombuffer(json.dumps(metadata).encode(), np.uint8)
    np.savez(old, **arrays)
    assert load_clip(old).uncertainty is None


@pytest.mark.parametrize(
    ("message", "fields"),
    [
        ("along_ray: expected shape (3, 3), got (3, 2)", {"along_ray": np.ones((3, 2))}),
        ("across_ray: 1 numbers that are not finite", {"across_ray": np.diag([1.0, np.inf, 1])}),
        ("along_ray: 1 standard deviations below 0 (first at (1, 1))",
         {"along_ray": np.diag([1.0, -1.0, 1.0])}),
    ],
)  # fmt: skip
def test_each_problem_is_named(message, fields):
    with pytest.raises(ClipError, match=re.escape(f"uncertainty.{message}")):
        spoiled(**fields).validate()


def test_lengths_are_scaled_with_the_world():
    clip = clips.observed(clips.z_up_centimeters())
    converted = to_y_up_meters(clip)
    for field in FIELDS:
        expected = 0.01 * getattr(clip.uncertainty, field)
        np.testing.assert_allclose(getattr(converted.uncertainty, field), expected, rtol=1e-6)


def test_joints_that_go_take_their_figures_with_them():
    clip = clips.observed(clips.random(joints=12, gaussians=20, keys=3))
    merged = within_limit(clip, 5)
    merged.validate()
    kept = [clip.rig.joint_names.index(name) for name in merged.rig.joint_names]
    for field in FIELDS:
        expected = getattr(clip.uncertainty, field)[:, kept]
        np.testing.assert_array_equal(getattr(merged.uncertainty, field), expected)


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_usd_holds_it_key_by_key_in_the_order_of_the_joints(tmp_path, suffix):
    clip = clips.observed(clips.chain())
    write_usd_rig(clip, tmp_path / f"c{suffix}")
    stage, animation = usd_animation(tmp_path / f"c{suffix}")
    for field, name in USD_NAMES.items():
        attribute = animation.GetAttribute(name)
        assert attribute.IsCustom()
        assert attribute.GetTypeName() == "float[]"
        assert attribute.GetTimeSamples() == [0.0, 1.0, 3.0]
        samples = [np.array(attribute.Get(time)) for time in (0.0, 1.0, 3.0)]
        np.testing.assert_array_equal(samples, getattr(clip.uncertainty, field))
    assert stage.GetDefaultPrim().IsValid()


def test_usd_leaves_out_the_keys_that_go(tmp_path):
    clip = clips.observed(clips.chain())
    write_usd_rig(clip, tmp_path / "c.usda", ExportOptions(tolerance=10, tolerance_degrees=360))
    _, animation = usd_animation(tmp_path / "c.usda")
    attribute = animation.GetAttribute(USD_NAMES["along_ray"])
    assert attribute.GetTimeSamples() == animation.GetAttribute("rotations").GetTimeSamples()
    last = attribute.GetTimeSamples()[-1]
    np.testing.assert_array_equal(np.array(attribute.Get(last)), clip.uncertainty.along_ray[-1])


def test_gltf_holds_the_mean_over_the_keys_in_meters(tmp_path):
    write_gltf(clips.observed(clips.z_up_centimeters()), tmp_path / "c.glb")
    nodes = {node.get("name"): node for node in gltf_reader.read(tmp_path / "c.glb").json["nodes"]}
    # Joint `door` is the second: 0.02 and 0.04 centimeters at the two keys.
    assert nodes["door"]["extras"]["splatimate_uncertainty_m"] == {
        "along_ray": pytest.approx(0.03 * 0.01),
        "across_ray": pytest.approx(0.006 * 0.01),
    }


def test_nothing_is_written_of_what_is_not_known(tmp_path):
    write_usd_rig(clips.chain(), tmp_path / "c.usda")
    assert "uncertainty" not in (tmp_path / "c.usda").read_text()
    write_gltf(clips.chain(), tmp_path / "c.gltf")
    assert "uncertainty" not in (tmp_path / "c.gltf").read_text()


def test_the_figures_are_private_and_read_only():
    figures = np.ones((3, 3))
    uncertainty = Uncertainty(along_ray=figures, across_ray=figures)
    figures[0] = 7.0
    assert uncertainty.along_ray.max() == 1.0
    with pytest.raises(ValueError, match="read-only"):
        uncertainty.along_ray[0] = 7.0
