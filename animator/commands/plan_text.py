"""What would run and what would be written, in words: for `inspect` and `--dry-run`."""

import math
from collections.abc import Iterable
from pathlib import Path

from animator.commands.export_choices import export_options
from animator.commands.outputs import OutputPlan
from animator.commands.profile_text import describe_changes
from animator.commands.size_estimate import ClipCounts, describe_bytes, estimate_sizes
from animator.config import AnimateOptions, default_of, option_infos
from animator.scene import Scene


def describe_plan(scene: Scene, options: AnimateOptions, plan: OutputPlan) -> str:
    """Describe a run that has not begun."""
    choices = export_options(options)
    counts = clip_counts(scene, options)
    seconds = counts.keys / scene.frames.fps
    steps = [
        f"solve {len(scene.frames)} frames with {options.anchors} anchors, "
        "twice as many if motion is smooth, "
        f"matcher {options.matcher}, device {options.device}, seed {options.seed}",
        f"write {counts.keys} frames, {seconds:.2f} s at {scene.frames.fps:g} frames per second",
    ]
    if options.inbetween:
        steps.insert(1, f"add {options.inbetween} smooth frames between two solved ones")
    if options.profile != default_of("profile"):
        chosen = ", ".join(describe_changes(choices))
        steps.append(f"write for {options.profile}: {chosen}")
    changed = _changed_options(options)
    if changed:
        steps.append(f"other than by default: {', '.join(changed)}")
    sizes = estimate_sizes(plan, counts, choices)
    lines = [
        "Found:",
        *_indented(scene.notes),
        "Would run:",
        *_indented(steps),
        "Would write:",
        *_indented(_describe_file(path, sizes.get(path)) for path in plan.files),
        f"About {describe_bytes(sum(sizes.values()))} in all.",
    ]
    return "\n".join(lines) + "\n"


def clip_counts(scene: Scene, options: AnimateOptions) -> ClipCounts:
    """Count what will be in the clip."""
    keys = len(scene.frames) + max(len(scene.frames) - 1, 0) * options.inbetween
    rate = (export_options(options).fps or scene.frames.fps) / scene.frames.fps
    return ClipCounts(
        gaussians=len(scene.gaussians),
        sh_coeffs=scene.gaussians.sh_coeffs.shape[1],
        joints=options.anchors + 1,
        keys=keys,
        cached=math.ceil((keys - 1) * rate) + 1,
    )


def _changed_options(options: AnimateOptions) -> list[str]:
    """List the options that are neither default nor told elsewhere in the plan."""
    told = {
        *("out", "dry_run", "verbose", "quiet", "overwrite"),
        *("profile", "anchors", "matcher", "device", "seed", "inbetween"),
    }
    return [
        f"{name.replace('_', '-')} = {_words(getattr(options, name))}"
        for name in option_infos()
        if name not in told and getattr(options, name) != default_of(name)
    ]


def _words(value: object) -> str:
    if isinstance(value, tuple):
        return ",".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _describe_file(path: Path, size_bytes: int | None) -> str:
    return str(path) if size_bytes is None else f"{path}  ~ {describe_bytes(size_bytes)}"


def _indented(lines: Iterable[str]) -> list[str]:
    return [f"  {line}" for line in lines]
