"""Animate from Python: the same as the command `animate`, with the result in memory.

Reads the frames and what lies beside them, fits, and writes the rigged asset and the exact motion.

Usage:
    python examples/01_animate.py examples/desk_lamp/frames OUT_FOLDER [--frames 0,3,6]
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from animator.pipeline import FitConfig, fit
from animator.rig.bake import ClipLabels
from animator.scene import FrameOptions, discover, read_scene
from animator.sequence.solved_frame import SolvedFrame
from exporters import Clip, export_clip, save_clip


def main(frames: Path, out_folder: Path, numbers: Sequence[int] | None = None) -> Clip:
    """Fit a clip and write it.

    Args:
        frames: Folder, glob, printf pattern or video.
        out_folder: Where the files go; made if it is not there.
        numbers: Only these frame numbers; None for all.

    Returns:
        The clip.
    """
    files = discover(frames)
    scene = read_scene(files, FrameOptions(numbers=tuple(numbers) if numbers else None))
    for note in scene.notes:
        print(note)

    labels = ClipLabels(name="lamp", fps=scene.frames.fps)
    result = fit(scene, labels, FitConfig(seed=0), on_frame=tell)

    out_folder.mkdir(parents=True, exist_ok=True)
    save_clip(result.clip, out_folder / "lamp.splatimate.npz")
    export_clip(result.clip, out_folder / "lamp.usdc")
    export_clip(result.clip, out_folder / "lamp_gaussians")
    return result.clip


def tell(index: int, solved: SolvedFrame) -> None:
    """Say how one frame went."""
    stats = solved.stats
    print(f"frame {index}: {stats.matches} matches, {stats.groups} rigid groups")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", metavar="FRAMES", type=Path)
    parser.add_argument("out_folder", metavar="OUT_FOLDER", type=Path)
    parser.add_argument("--frames", metavar="N,N", help="only these frame numbers")
    arguments = parser.parse_args()
    chosen = [int(number) for number in arguments.frames.split(",")] if arguments.frames else None
    main(arguments.source, arguments.out_folder, chosen)
