import dataclasses

import numpy as np
import plyfile
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.errors import ClipError, WriteError
from exporters.ply.sequence import write_ply_sequence
from tests.helpers import clips


def column(vertices, *names: str) -> np.ndarray:
    return np.stack([vertices[name] for name in names], axis=-1)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_plyfile_reads_back_every_frame(tmp_path, degree):
    clip = clips.random(sh_degree=degree)
    paths = write_ply_sequence(clip, tmp_path / "clip_gaussians")
    last_code = round(clip.tracks.times_s[-1] * clip.fps)
    assert [path.name for path in paths] == [f"clip_{k:04d}.ply" for k in range(last_code + 1)]
    for code, path in enumerate(paths):
        ply = plyfile.PlyData.read(path)
        assert (ply.byte_order, ply.text, len(ply.elements)) == ("<", False, 1)
        vertices = ply["vertex"]
        posed = clip.pose_at(code / clip.fps)
        np.testing.assert_array_equal(column(vertices, "x", "y", "z"), posed.positions)
        quats_wxyz = column(vertices, "rot_0", "rot_1", "rot_2", "rot_3")
        cosines = np.sum(quats_wxyz * posed.quats_wxyz, axis=1)
        np.testing.assert_allclose(np.abs(cosines), 1, atol=1e-6)
        scales = np.exp(column(vertices, "scale_0", "scale_1", "scale_2"))
        np.testing.assert_allclose(scales, clip.splats.scales, rtol=1e-6)
        opacities = 1 / (1 + np.exp(-vertices["opacity"]))
        np.testing.assert_allclose(opacities, clip.splats.opacities, atol=1e-6)
        base = column(vertices, "f_dc_0", "f_dc_1", "f_dc_2")
        np.testing.assert_array_equal(base, clip.splats.sh_coeffs[:, 0])


def test_higher_harmonics_are_channel_major(tmp_path):
    clip = clips.random(sh_degree=3)
    vertices = plyfile.PlyData.read(write_ply_sequence(clip, tmp_path / "s")[0])["vertex"]
    for coefficient in range(1, 16):
        for channel in range(3):
            np.testing.assert_array_equal(
                vertices[f"f_rest_{channel * 15 + coefficient - 1}"],
                clip.splats.sh_coeffs[:, coefficient, channel],
            )


def test_header_is_the_strict_one_byte_for_byte(tmp_path):
    data = write_ply_sequence(clips.static(), tmp_path / "s")[0].read_bytes()
    names = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity "
    names += "scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
    header += "".join(f"property float {name}\n" for name in names.split()) + "end_header\n"
    assert data.startswith(header.encode())
    assert len(data) == len(header) + 3 * 17 * 4


def test_hinge_by_hand(tmp_path):
    paths = write_ply_sequence(clips.hinge(), tmp_path / "s")
    assert len(paths) == 25
    half = plyfile.PlyData.read(paths[12])["vertex"]
    root_half = np.sqrt(0.5)
    np.testing.assert_allclose(
        column(half, "x", "y", "z")[1], [1 + root_half, root_half, 0], atol=1e-6
    )
    np.testing.assert_allclose(
        column(half, "rot_0", "rot_1", "rot_2", "rot_3")[1],
        [np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)],
        atol=1e-6,
    )


def test_rotation_signs_are_continuous_through_a_full_turn(tmp_path):
    clip = clips.hinge()
    angles = np.linspace(0, 2 * np.pi, 9)
    quats_wxyz = np.tile(clips.IDENTITY, (9, 2, 1))
    quats_wxyz[:, 1] = np.stack([np.cos(angles / 2), 0 * angles, 0 * angles, np.sin(angles / 2)], 1)
    tracks = dataclasses.replace(
        clip.tracks,
        times_s=np.arange(9) / 24,
        translations=np.tile(clip.rig.rest_translations, (9, 1, 1)),
        quats_wxyz=quats_wxyz,
    )
    clip = dataclasses.replace(clip, tracks=tracks, source_frames=())
    rows = [
        column(plyfile.PlyData.read(path)["vertex"], "rot_0", "rot_1", "rot_2", "rot_3")
        for path in write_ply_sequence(clip, tmp_path / "s")
    ]
    cosines = np.einsum("tni,tni->tn", rows[1:], rows[:-1])
    np.testing.assert_allclose(cosines[:, 1], np.cos(np.pi / 8), atol=1e-6)


@settings(derandomize=True, max_examples=20, deadline=None)
@given(opacity=st.floats(0, 1, width=32))
def test_every_opacity_gets_a_finite_logit(tmp_path_factory, opacity):
    clip = clips.static()
    splats = dataclasses.replace(clip.splats, opacities=np.full(3, opacity))
    folder = tmp_path_factory.mktemp("ply") / "s"
    clip = dataclasses.replace(clip, splats=splats)
    logits = plyfile.PlyData.read(write_ply_sequence(clip, folder)[0])["vertex"]["opacity"]
    assert np.isfinite(logits).all()
    # A float32 logit of 14 is known to 1e-6, the opacity margin is 1e-6.
    np.testing.assert_allclose(1 / (1 + np.exp(-logits.astype(float))), opacity, atol=1.5e-6)


def test_moved_opacities_are_counted(tmp_path, caplog):
    clip = clips.static()
    splats = dataclasses.replace(clip.splats, opacities=[0.0, 0.5, 1.0])
    write_ply_sequence(dataclasses.replace(clip, splats=splats), tmp_path / "s")
    assert [r.message for r in caplog.records if "2 opacities" in r.message]


def test_unturned_harmonics_are_said_once(tmp_path, caplog):
    write_ply_sequence(clips.random(sh_degree=1), tmp_path / "a")
    assert len([r for r in caplog.records if "spherical harmonics" in r.message]) == 1
    caplog.clear()
    write_ply_sequence(clips.hinge(), tmp_path / "b")
    assert not caplog.records


def test_progress_and_an_interrupt_leave_nothing(tmp_path):
    calls = []

    def interrupted(done: int, total: int) -> None:
        calls.append((done, total))
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_ply_sequence(clips.hinge(), tmp_path / "s", progress=interrupted)
    assert calls == [(1, 25), (2, 25), (3, 25)]
    assert not list(tmp_path.iterdir())


def test_older_sequence_is_replaced_but_no_other_folder(tmp_path):
    write_ply_sequence(clips.hinge(), tmp_path / "s")
    assert len(write_ply_sequence(clips.static(), tmp_path / "s")) == 1
    assert [p.name for p in (tmp_path / "s").iterdir()] == ["clip_0000.ply"]
    (tmp_path / "s" / "holiday.jpg").write_text("precious")
    with pytest.raises(WriteError, match=r"holiday\.jpg"):
        write_ply_sequence(clips.static(), tmp_path / "s")
    assert (tmp_path / "s" / "holiday.jpg").exists()


def test_invalid_clip_is_refused(tmp_path):
    with pytest.raises(ClipError):
        write_ply_sequence(dataclasses.replace(clips.static(), fps=-1), tmp_path / "s")
