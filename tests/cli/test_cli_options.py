import dataclasses
from pathlib import Path

import pytest

from animator.commands.arguments import add_animate_arguments, animate_options
from animator.commands.config_file import read_config_file
from animator.commands.export_choices import CHOICES, export_options
from animator.config import AnimateOptions
from animator.errors import InputError
from exporters.options import ExportOptions
from exporters.profiles import PROFILES


def parse(*argv: str) -> AnimateOptions:
    import argparse

    parser = argparse.ArgumentParser(prog="animate")
    add_animate_arguments(parser)
    return animate_options(parser.parse_args(argv))


def write_toml(folder: Path, text: str) -> str:
    (folder / "run.toml").write_text(text)
    return str(folder / "run.toml")


def test_defaults_are_those_of_the_dataclass():
    assert parse("frames") == AnimateOptions()


def test_flag_wins_over_file_wins_over_default(tmp_path):
    file = write_toml(tmp_path, "seed = 4\nevery = 2\n")
    options = parse("frames", "--config", file, "--every", "3")
    assert options == AnimateOptions(seed=4, every=3)


def test_a_flag_can_undo_every_switch_of_a_file(tmp_path):
    file = write_toml(tmp_path, "overwrite = true\ngroup = false\n")
    assert parse("frames", "--config", file) == AnimateOptions(overwrite=True, group=False)
    assert parse("frames", "--config", file, "--no-overwrite", "--group") == AnimateOptions()


def test_every_option_can_be_set_in_a_file(tmp_path):
    text = """
    gaussians = "a.ply"
    cameras = "c.json"
    frame-camera = "auto"
    moving_camera = true
    masks = "m"
    depth = "d"
    frames = [0, 6]
    every = 2
    inbetween = 3
    fps = 30
    max-size = 640
    out = ["x.usd", "y.glb"]
    cache = "none"
    name = "n"
    up-axis = "Z"
    meters-per-unit = 0.01
    overwrite = true
    profile = "unreal"
    mesh = "both"
    faces = 500
    splats = "parts"
    usd-splats = "payload"
    rotate-sh = true
    precision = "half"
    tolerance = 0.001
    tolerance-degrees = 0
    matcher = "flow"
    roma-weights = "w.pth"
    anchors = 99
    iterations = 8
    min-iou = 0
    seed = 1
    deform = false
    group = false
    region-growing = false
    refinement = false
    device = "cpu"
    threads = 1
    resume = true
    dry-run = true
    quiet = true
    verbose = true
    """
    values = read_config_file(Path(write_toml(tmp_path, text)))
    assert set(values) == {field.name for field in dataclasses.fields(AnimateOptions)}
    assert values["frames"] == (0, 6)
    assert values["fps"] == 30.0
    # Paths count from the file's folder; `auto` is a word.
    assert values["out"] == (tmp_path / "x.usd", tmp_path / "y.glb")
    assert values["roma_weights"] == (tmp_path / "w.pth",)
    assert values["frame_camera"] == Path("auto")


def test_choices_for_the_writers_are_flag_over_file_over_profile_over_default(tmp_path):
    assert export_options(AnimateOptions()) == ExportOptions()
    file = write_toml(tmp_path, 'profile = "web"\nfaces = 100\nsplats = "parts"\n')
    choices = export_options(parse("frames", "--config", file, "--splats", "rest"))
    web = PROFILES["web"].options
    assert choices == dataclasses.replace(web, faces=100, splats="rest")
    assert choices.mesh == "surface"


def test_a_flag_can_undo_a_choice_of_a_profile():
    zero = parse("frames", "--profile", "web", "--tolerance", "0", "--mesh", "quads")
    assert (export_options(zero).tolerance, export_options(zero).mesh) == (0.0, "quads")


def test_the_choices_are_the_fields_that_mean_the_same_to_both():
    """`up_axis`, `meters_per_unit` and `fps` of the command line describe the inputs."""
    shared = {f.name for f in dataclasses.fields(AnimateOptions)}
    shared &= {f.name for f in dataclasses.fields(ExportOptions)}
    assert shared == {*CHOICES, "up_axis", "meters_per_unit", "fps"}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("evry = 2", ("evry", "did you mean every?")),
        ("frame_camra = 'auto'", ("frame_camra", "frame-camera")),
        ("zzz = 2", ("zzz", "known keys", "matcher")),
        ("[method]\nseed = 1", ("method", "unknown key")),
        ("every = 'two'", ("every", "whole number", "'two'")),
        ("every = true", ("every", "whole number", "True")),
        ("every = 0", ("every", "1 or more", "0")),
        ("anchors = 2.5", ("anchors", "whole number", "2.5")),
        ("fps = 0", ("fps", "above 0", "0")),
        ("fps = inf", ("fps", "above 0", "inf")),
        ("faces = 99", ("faces", "100 or more", "99")),
        ("mesh = 'box'", ("mesh", "quads, surface, both or none", "'box'")),
        ("tolerance-degrees = -1", ("tolerance-degrees", "0 or more", "-1")),
        ("min-iou = 1.5", ("min-iou", "0 to 1", "1.5")),
        ("overwrite = 'yes'", ("overwrite", "true or false", "'yes'")),
        ("matcher = 'sift'", ("matcher", "auto, flow, xfeat or roma", "'sift'")),
        ("frames = []", ("frames", "list")),
        ("frames = '0,6'", ("frames", "list")),
        ("out = [3]", ("out", "path", "3")),
        ("frame-camera = 'a'\nframe_camera = 'b'", ("frame", "twice")),
        ("every = ", ("TOML",)),
    ],
)
def test_wrong_files_are_explained(tmp_path, text, parts):
    file = write_toml(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_config_file(Path(file))
    for part in (file, *parts):
        assert part in str(caught.value)


def test_a_missing_file_is_bad_input(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.toml"):
        read_config_file(tmp_path / "nowhere.toml")


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--every", "0"], "expected a whole number, 1 or more, found '0'"),
        (["--frames", "0,x"], "found '0,x'"),
        (["--device", "tpu"], "expected auto, cpu or cuda, found 'tpu'"),
        (["--min-iou", "nan"], "expected a number from 0 to 1, found 'nan'"),
        (["--nonsense"], "--nonsense"),
    ],
)
def test_wrong_flags_are_usage_errors(capsys, flags, message):
    with pytest.raises(SystemExit) as caught:
        parse("frames", *flags)
    assert caught.value.code == 2
    assert message in capsys.readouterr().err
