"""`splatimate inspect`: what was found, what is missing, what would run, how large it gets."""

import sys
from pathlib import Path

from animator.commands.animate import load_scene
from animator.commands.exit_code import ExitCode
from animator.commands.outputs import OutputPlan
from animator.commands.plan_text import describe_plan
from animator.config import AnimateOptions
from animator.errors import InputError
from animator.scene import open_frames, read_cameras, read_ply


def run_inspect(source: Path, options: AnimateOptions, plan: OutputPlan) -> ExitCode:
    """Print the plan of the main job, or what keeps it from running.

    Returns:
        `DONE` if the main job could run, else `BAD_INPUT`.
    """
    try:
        scene = load_scene(source, options)
    except InputError as error:
        sys.stdout.write(_describe_obstacles(source, options, error))
        return ExitCode.BAD_INPUT
    sys.stdout.write(describe_plan(scene, options, plan))
    return ExitCode.DONE


def _describe_obstacles(source: Path, options: AnimateOptions, error: InputError) -> str:
    """Say what is wrong, and what of the rest is fine, so that all can be mended in one go."""
    checks = {
        "frames": lambda: open_frames(source),
        "Gaussians": options.gaussians and (lambda: read_ply(options.gaussians or "")),
        "cameras": options.cameras and (lambda: read_cameras(options.cameras or "")),
    }
    problems = [str(error)]
    fine = []
    for name, check in checks.items():
        if check is None:
            continue
        try:
            check()
            fine.append(name)
        except InputError as other:
            if str(other) not in problems:
                problems.append(str(other))
    lines = ["The animation cannot run:", *(f"  {problem}" for problem in problems)]
    if fine:
        lines.append(f"Found and readable: {', '.join(fine)}.")
    return "\n".join(lines) + "\n"
