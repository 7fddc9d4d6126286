from pathlib import Path

import pytest

from animator.cli import animate_main
from animator.commands.outputs import OutputNameError, plan_animation, plan_export
from exporters.errors import WriteError
from exporters.options import ExportOptions


def test_sidecars_lie_beside_the_first_output(tmp_path):
    outs = (tmp_path / "a" / "x.usd", tmp_path / "b" / "y.gltf")
    plan = plan_animation(outs, "both", ExportOptions())
    assert [path.relative_to(tmp_path).as_posix() for path in plan.files] == [
        "a/x.usd",
        "b/y.gltf",
        "b/y.bin",
        "a/x_gaussians",
        "a/x_gaussians.usdc",
        "a/x.splatimate.npz",
        "a/x_report.json",
        "a/x_report.html",
        "a/x_report.png",
    ]
    assert plan.progress == tmp_path / "a" / "x.progress.npz"


def test_a_dotted_stem_is_kept():
    plan = plan_animation((Path("shot.v2.usd"),), "none", ExportOptions())
    assert plan.clip == Path("shot.v2.splatimate.npz")


@pytest.mark.parametrize(
    ("cache", "names"),
    [
        ("ply", {"x_gaussians"}),
        ("usd", {"x_gaussians.usdc"}),
        ("both", {"x_gaussians", "x_gaussians.usdc"}),
        ("none", set()),
    ],
)
def test_export_writes_the_caches_that_were_asked_for(cache, names):
    plan = plan_export((Path("x.glb"),), cache, ExportOptions())
    assert {path.name for path in plan.files} == {"x.glb"} | names


@pytest.mark.parametrize(
    ("out", "options", "companions"),
    [
        ("x.usdc", {"usd_splats": "payload"}, ["x_splats.usdc"]),
        ("x.usdc", {"usd_splats": "sibling"}, []),
        ("x.usdz", {"usd_splats": "payload", "texture": True, "mesh": "surface"}, []),
        ("x.usda", {"texture": True, "mesh": "both"}, ["x_colors.png"]),
        ("x.usda", {"texture": True, "mesh": "quads"}, []),
        ("x.GLTF", {"usd_splats": "payload"}, ["x.bin"]),
    ],
)
def test_what_lies_beside_an_asset_is_planned(tmp_path, out, options, companions):
    plan = plan_export((tmp_path / out,), "none", ExportOptions(**options))
    assert plan.files == (tmp_path / out, *(tmp_path / name for name in companions))


@pytest.mark.parametrize(
    "outs",
    [
        ["clip"],
        ["clip.obj"],
        ["clip.usd", "clip.USD"],
        ["clip.usd", "clip.usd"],
        ["clip_gaussians.usdc"],
    ],
)
def test_unusable_names_are_usage_errors(outs, capsys):
    with pytest.raises(OutputNameError):
        plan_animation([Path(out) for out in outs], "both", ExportOptions())
    with pytest.raises(SystemExit) as caught:
        animate_main(["frames", *(part for out in outs for part in ("--out", out))])
    assert caught.value.code == 2
    assert "--out" in capsys.readouterr().err


def test_no_output_is_a_usage_error():
    with pytest.raises(SystemExit) as caught:
        animate_main(["frames"])
    assert caught.value.code == 2


def test_a_file_in_place_of_a_folder_is_refused_even_with_overwrite(tmp_path):
    plan = plan_animation((tmp_path / "x.usd",), "ply", ExportOptions())
    (tmp_path / "x_gaussians").write_text("a file")
    with pytest.raises(WriteError, match="expected a folder to replace, found a file"):
        plan.check(overwrite=True)


def test_a_folder_in_place_of_a_file_is_refused_even_with_overwrite(tmp_path):
    plan = plan_animation((tmp_path / "x.usd",), "ply", ExportOptions())
    (tmp_path / "x_report.html").mkdir()
    with pytest.raises(WriteError, match="expected a file to replace, found a folder"):
        plan.check(overwrite=True)


def test_a_file_in_place_of_the_output_folder_is_refused(tmp_path):
    (tmp_path / "folder").write_text("a file")
    plan = plan_animation((tmp_path / "folder" / "x.usd",), "none", ExportOptions())
    with pytest.raises(WriteError, match="is a file"):
        plan.check(overwrite=False)


def test_a_dangling_link_counts_as_existing(tmp_path):
    (tmp_path / "x.glb").symlink_to(tmp_path / "nowhere")
    with pytest.raises(WriteError, match="--overwrite"):
        plan_export((tmp_path / "x.glb",), "none", ExportOptions()).check(overwrite=False)
