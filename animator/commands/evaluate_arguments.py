"""The flags of `splatimate evaluate`: its own, and those of `animate` that choose the method."""

import argparse
import dataclasses
from pathlib import Path

from animator.commands.arguments import add_option
from animator.config import METHOD, option_infos

SCENE_PLACEHOLDER = "{scene}"
"""Stands for the scene's name in `--clip`."""
TASK_NAMES = ("clip", "single", "interpolate2", "interpolate4", "noise", "half-views", "depth")
"""Keys of `animator.evaluation.tasks.TASKS`, which needs torch; a test compares."""
DEFAULT_METHODS = "static,full"
_NOT_ASKED = ("min_iou",)
_SHARED = ("frames", "frame_camera", "device", "threads", "overwrite", "quiet", "verbose")


@dataclasses.dataclass(frozen=True, kw_only=True)
class EvaluateChoices:
    """What only this command is asked."""

    scenes: tuple[Path, ...]
    """Scenes, or folders of scenes."""
    folder: Path
    """Where everything goes."""
    task: str
    """One of `TASK_NAMES`."""
    methods: str
    """Comma-separated methods and sets."""
    clip: str | None
    """A result to score instead of fitting."""
    lpips_weights: tuple[Path, ...]
    """Weight files that the user brings."""


def add_evaluate_arguments(parser: argparse.ArgumentParser) -> None:
    """Add SCENE and every flag to a parser."""
    parser.add_argument(
        "scenes", metavar="SCENE", type=Path, nargs="+", help="a scene, or a folder of scenes"
    )
    parser.add_argument(
        "-o", "--out", dest="folder", metavar="DIR", type=Path, required=True, help="where to"
    )
    parser.add_argument(
        "--task",
        metavar="{" + ",".join(TASK_NAMES) + "}",
        choices=TASK_NAMES,
        default=TASK_NAMES[0],
        help="what is asked of the methods (default: clip)",
    )
    parser.add_argument(
        "--methods",
        metavar="NAME[,NAME...]",
        default=DEFAULT_METHODS,
        help="static, rgb-only, rgb-arap, no-match, no-deform-group, no-group, no-region-growing, "
        f"no-refinement, full; or baselines, ablation, all (default: {DEFAULT_METHODS})",
    )
    parser.add_argument(
        "--clip",
        metavar="PATH",
        help="score this .splatimate.npz, or folder of one PLY a frame, instead of fitting; "
        f"{SCENE_PLACEHOLDER} stands for the scene's name",
    )
    parser.add_argument(
        "--lpips-weights",
        metavar="FILE",
        type=Path,
        action="append",
        default=[],
        help="weights of AlexNet and of LPIPS, for LPIPS; twice",
    )
    group = parser.add_argument_group("as of animate")
    of_method = [name for name, info in option_infos().items() if info.group == METHOD]
    for name in (*of_method, *_SHARED):
        if name not in _NOT_ASKED:
            add_option(group, name)


def evaluate_choices(arguments: argparse.Namespace) -> EvaluateChoices:
    """Return what only this command is asked."""
    return EvaluateChoices(
        scenes=tuple(arguments.scenes),
        folder=arguments.folder,
        task=arguments.task,
        methods=arguments.methods,
        clip=arguments.clip,
        lpips_weights=tuple(arguments.lpips_weights),
    )
