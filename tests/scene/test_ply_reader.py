import gzip
import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plyfile import PlyData, PlyElement

from animator.errors import InputError
from animator.scene import read_ply

BASE = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"


def write(path, values, *, text=False, byte_order="<", kinds="f4"):
    """Write columns with plyfile, in the order of the mapping."""
    kinds = [kinds] * len(values) if isinstance(kinds, str) else kinds
    rows = np.empty(len(values["x"]), [(n, k) for n, k in zip(values, kinds, strict=True)])
    for name, column in values.items():
        rows[name] = column
    element = PlyElement.describe(rows, "vertex")
    PlyData([element], text=text, byte_order="=" if text else byte_order).write(path)
    return path


def random_values(count=4, degree=0, seed=0):
    rng = np.random.default_rng(seed)
    names = BASE.split() + [f"f_rest_{i}" for i in range(3 * ((degree + 1) ** 2 - 1))]
    return {name: rng.normal(size=count).astype(np.float32) for name in names}


def header(count, names=BASE, encoding="binary_little_endian"):
    properties = "".join(f"property float {name}\n" for name in names.split())
    text = f"ply\nformat {encoding} 1.0\nelement vertex {count}\n{properties}end_header\n"
    return text.encode()


def test_values_are_activated_by_hand_calculation(tmp_path):
    values = {name: [0.0] for name in BASE.split()}
    values |= {"x": [1.0], "y": [-2.0], "z": [3.0], "opacity": [math.log(3)]}
    values |= {"scale_0": [0.0], "scale_1": [math.log(2)], "scale_2": [-math.log(4)]}
    values |= {"rot_0": [2.0], "rot_1": [0.0], "rot_2": [-4.0], "rot_3": [4.0]}
    values |= {"f_dc_0": [0.1], "f_dc_1": [0.2], "f_dc_2": [0.3]}
    gaussians = read_ply(write(tmp_path / "one.ply", values))
    torch.testing.assert_close(gaussians.means, torch.tensor([[1.0, -2.0, 3.0]]))
    torch.testing.assert_close(gaussians.opacities, torch.tensor([0.75]))
    torch.testing.assert_close(gaussians.scales, torch.tensor([[1.0, 2.0, 0.25]]))
    torch.testing.assert_close(gaussians.quats_wxyz, torch.tensor([[1 / 3, 0.0, -2 / 3, 2 / 3]]))
    torch.testing.assert_close(gaussians.sh_coeffs, torch.tensor([[[0.1, 0.2, 0.3]]]))


@pytest.mark.parametrize(("degree", "count"), [(1, 4), (2, 9), (3, 16)])
def test_spherical_harmonics_are_stored_channel_by_channel(tmp_path, degree, count):
    values = random_values(2, degree)
    for index in range(3 * (count - 1)):
        values[f"f_rest_{index}"] = [index, index + 100]
    coeffs = read_ply(write(tmp_path / "sh.ply", values)).sh_coeffs
    assert coeffs.shape == (2, count, 3)
    # Coefficient k of channel c is f_rest[c * (K - 1) + k - 1].
    for c in range(3):
        assert coeffs[0, 1:, c].tolist() == [c * (count - 1) + k for k in range(count - 1)]
    assert coeffs[1, 1, 2] == 100 + 2 * (count - 1)


@settings(derandomize=True, max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 100),
    degree=st.integers(0, 3),
    encoding=st.sampled_from(["<", ">", "text"]),
    kind=st.sampled_from(["f4", "f8"]),
)
def test_any_order_and_encoding_reads_the_same(tmp_path_factory, seed, degree, encoding, kind):
    folder = tmp_path_factory.mktemp("ply")
    values = random_values(3, degree, seed)
    values["extra"] = np.arange(3)
    expected = read_ply(write(folder / "plain.ply", values))
    names = list(values)
    np.random.default_rng(seed).shuffle(names)
    path = write(
        folder / "other.ply",
        {name: values[name] for name in names},
        text=encoding == "text",
        byte_order="<" if encoding == "text" else encoding,
        kinds=["u1" if name == "extra" else kind for name in names],
    )
    found = read_ply(path)
    for field in ("means", "quats_wxyz", "scales", "opacities", "sh_coeffs"):
        torch.testing.assert_close(getattr(found, field), getattr(expected, field))
        assert getattr(found, field).dtype == torch.float32
    np.testing.assert_array_equal(found.means[:, 1], values["y"])


def test_half_floats_comments_windows_line_ends_and_other_elements(tmp_path, caplog):
    rows = np.arange(1, 18, dtype="<f2")
    properties = "".join(f"property half {name}\r\n" for name in BASE.split())
    text = (
        "ply\r\nformat binary_little_endian 1.0\r\ncomment Größe end_header\r\n"
        "comment SplatRenderMode: mip\r\nobj_info x\r\nelement camera 2\r\nproperty uchar id\r\n"
        f"element vertex 1\r\n{properties}element face 1\r\nproperty list uchar int ids\r\n"
        "end_header\r\n"
    )
    path = tmp_path / "odd.ply"
    path.write_bytes(text.encode() + b"\x07\x08" + rows.tobytes() + b"\x00")
    gaussians = read_ply(path)
    assert gaussians.means.tolist() == [[1.0, 2.0, 3.0]]
    assert gaussians.sh_coeffs.tolist() == [[[7.0, 8.0, 9.0]]]
    assert "render mode mip" in caplog.text


def test_ascii_with_an_element_before(tmp_path):
    text = header(1, encoding="ascii").replace(
        b"element vertex", b"element camera 2\nproperty float id\nelement vertex"
    )
    path = tmp_path / "text.ply"
    path.write_bytes(text + b"70\n80\n" + " ".join(str(i) for i in range(1, 18)).encode() + b"\n")
    assert read_ply(path).means.tolist() == [[1.0, 2.0, 3.0]]


def test_broken_gaussians_are_dropped_and_counted_once(tmp_path, caplog):
    values = random_values(12)
    values["x"][0] = np.nan
    values["scale_1"][1] = np.inf
    values["scale_1"][2] = 200.0  # e^200 is beyond float32
    for axis in range(4):
        values[f"rot_{axis}"][3] = 0.0
    values["f_dc_1"][4] = -np.inf
    gaussians = read_ply(write(tmp_path / "broken.ply", values))
    np.testing.assert_array_equal(gaussians.means[:, 0], values["x"][5:])
    assert len(caplog.records) == 1
    message = caplog.messages[0]
    assert "dropped 5 of 12" in message
    assert "2 with a non-finite or zero size" in message
    assert "1 with a non-finite or zero quaternion" in message


def test_infinite_logits_saturate_inside_the_open_interval(tmp_path):
    values = random_values(2) | {"opacity": np.float32([np.inf, -np.inf])}
    opacities = read_ply(write(tmp_path / "inf.ply", values)).opacities
    assert 0 < opacities[1] < 1e-6
    assert 1 - 1e-6 < opacities[0] < 1


def test_mostly_broken_is_refused(tmp_path):
    values = random_values(3)
    values["x"][:2] = np.nan
    with pytest.raises(InputError, match=r"nan\.ply: 2 of 3 Gaussians are broken"):
        read_ply(write(tmp_path / "nan.ply", values))


def test_cut_file_names_promised_and_found_counts(tmp_path):
    path = write(tmp_path / "model.ply", random_values(10))
    data = path.read_bytes()
    path.write_bytes(data[:-100])  # 68 bytes a Gaussian: two are incomplete
    with pytest.raises(InputError) as error:
        read_ply(path)
    assert str(error.value) == (
        f"{path}: cut off: the header promises 10 Gaussians of 68 bytes, the file holds 8 whole "
        "ones; copy or export the file again."
    )


@pytest.mark.parametrize("count", [2**31, 2**63, 10**17, 10**40])
@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian", "ascii"])
def test_absurd_counts_are_refused_before_allocation(tmp_path, count, encoding):
    path = tmp_path / "bomb.ply"
    path.write_bytes(header(count, encoding=encoding) + b"0 " * 68)
    with pytest.raises(InputError, match=r"bomb\.ply"):
        read_ply(path)


BODY = bytes(68)
MALFORMED = {
    "no Gaussians": (header(0), "expected at least one Gaussian, found 0"),
    "negative": (header(-1) + BODY, "header line 3: cannot be understood"),
    "not a ply": (b"solid cube", "expected a PLY file, found one that starts with b'solid cu'"),
    "empty": (b"", "expected a PLY file"),
    "no end": (header(1)[:-11], "no line end_header"),
    "endless line": (b"ply\ncomment " + b"x" * 2**20, "no line end_header"),
    "no format": (header(1).replace(b"format binary_little_endian 1.0\n", b""), "no line format"),
    "unknown type": (header(1).replace(b"float y", b"quad y"), "line 5: cannot be understood"),
    "twice": (header(1, BASE + " x") + BODY, "the property x of vertex is there twice"),
    "no vertex": (header(1).replace(b"vertex", b"face"), "expected an element vertex, found face"),
    "list": (
        header(1).replace(b"property float x\n", b"property list uchar int x\n"),
        "found a list property",
    ),
    "no properties": (header(1, ""), "expected properties, found none"),
    "too long": (header(1) + bytes(69), "describes 68 bytes of data, the file holds 69"),
    "2DGS": (header(1, BASE.replace(" scale_2", "")) + bytes(64), "2D Gaussian splat"),
    "points": (header(1, "x y z") + bytes(12), "plain point cloud"),
    "no color": (header(1, BASE.replace(" f_dc_1", "")) + bytes(64), "f_dc_1 are missing"),
    "compressed": (header(1, "packed_position") + bytes(4), "splat-transform"),
    "7 f_rest": (
        header(1, BASE + "".join(f" f_rest_{i}" for i in range(7))) + bytes(96),
        "found 7 properties",
    ),
    "holes in f_rest": (
        header(1, BASE + "".join(f" f_rest_{i}" for i in range(1, 10))) + bytes(104),
        "f_rest_0 to f_rest_8",
    ),
    "words": (header(1, encoding="ascii") + b"one " * 17 + b"\n", "expected 17 numbers a line"),
    "short line": (header(1, encoding="ascii") + b"100000 " * 16 + b"\n", "17 numbers, found 1 of"),
    "few lines": (header(2, encoding="ascii") + b"1.000 " * 17 + b"\n", "found 1 of 17"),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_files_say_what_is_wrong(tmp_path, case):
    content, expected = MALFORMED[case]
    path = tmp_path / "model.ply"
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        read_ply(path)
    assert str(error.value).startswith(str(path))
    assert expected in str(error.value)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(position=st.integers(0, 600), value=st.integers(0, 255), cut=st.integers(0, 800))
def test_damage_gives_gaussians_or_an_input_error(tmp_path_factory, position, value, cut):
    path = write(tmp_path_factory.mktemp("fuzz") / "a.ply", random_values(3))
    data = bytearray(path.read_bytes())
    data[min(position, len(data) - 1)] = value
    path.write_bytes(data[: max(cut, 1)])
    try:
        assert len(read_ply(path)) >= 1
    except InputError as error:
        assert "a.ply" in str(error)


@pytest.mark.parametrize("suffix", [".spz", ".splat", ".ksplat", ".sog"])
def test_other_formats_ask_to_convert(tmp_path, suffix):
    path = tmp_path / f"model{suffix}"
    path.write_bytes(b"1234")
    with pytest.raises(InputError, match="splat-transform"):
        read_ply(path)


def test_other_formats_are_known_by_content(tmp_path):
    path = tmp_path / "renamed.ply"
    path.write_bytes(gzip.compress(b"NGSP"))
    with pytest.raises(InputError, match="gzip"):
        read_ply(path)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_ply(tmp_path / "none.ply")
