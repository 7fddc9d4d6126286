import pytest

from animator.commands.outputs import plan_animation
from animator.commands.progress import TimeLeft, describe_time_left
from animator.commands.size_estimate import ClipCounts, describe_bytes, estimate_sizes
from exporters.options import ExportOptions
from exporters.registry import export_clip
from tests.helpers import clips


def test_the_rest_frame_and_the_first_solved_one_do_not_count():
    left = TimeLeft(frame_count=6, done_count=0, now_s=100.0)
    left.frame_done(101.0)  # rest pose
    left.frame_done(161.0)  # compiles
    assert left.seconds is None
    assert left.frame_done(165.0) == 4.0
    assert left.seconds == 3 * 4.0
    left.frame_done(175.0)
    assert left.seconds == 2 * (4.0 + 10.0) / 2


def test_after_a_resume_only_the_first_frame_does_not_count():
    left = TimeLeft(frame_count=5, done_count=2, now_s=0.0)
    left.frame_done(60.0)
    assert left.seconds is None
    left.frame_done(65.0)
    assert left.seconds == 5.0


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (None, "time left unknown"),
        (12.4, "12 s left"),
        (150.0, "about 2 min left"),
        (7200.0, "about 2.0 h left"),
    ],
)
def test_time_left_in_words(seconds, text):
    assert describe_time_left(seconds) == text


@pytest.mark.parametrize(
    ("size", "text"),
    [(999, "999 bytes"), (1500, "1.5 kB"), (24_800_000, "25 MB"), (2_976_000_000, "3.0 GB")],
)
def test_sizes_in_words(size, text):
    assert describe_bytes(size) == text


@pytest.mark.parametrize(
    "choices",
    [ExportOptions(), ExportOptions(splats="none", fps=48.0)],
    ids=["default", "no splats, twice the rate"],
)
def test_size_estimates_hold_for_written_files(tmp_path, choices):
    clip = clips.random(gaussians=2000, joints=20, keys=12, sh_degree=1)
    frames = round(clip.tracks.times_s[-1] * clip.fps) + 1
    outs = [tmp_path / f"x{end}" for end in (".usdc", ".glb", ".usda")]
    plan = plan_animation(outs, "both", choices)
    cached = (frames - 1) * round((choices.fps or clip.fps) / clip.fps) + 1
    counts = ClipCounts(gaussians=2000, sh_coeffs=4, joints=20, keys=frames, cached=cached)
    for path, estimate in estimate_sizes(plan, counts, choices).items():
        export_clip(clip, path, choices)
        files = path.iterdir() if path.is_dir() else [path]
        size = sum(file.stat().st_size for file in files)
        if path in plan.assets:
            assert 0.6 * estimate < size < estimate
        else:
            assert size == pytest.approx(estimate, rel=0.05)
