"""Read a saved clip: its joints, its keys, and where the Gaussians are at any time.

Usage:
    python examples/03_inspect_clip.py out/clip.splatimate.npz
"""

import argparse
from pathlib import Path

import numpy as np

from exporters import Clip, load_clip


def main(clip_path: Path) -> Clip:
    """Say what is in a clip; return it."""
    clip = load_clip(clip_path)
    times_s = clip.tracks.times_s
    print(f"{clip.name}: {len(clip.splats)} Gaussians of SH degree {clip.splats.sh_degree}")
    print(f"{len(clip.rig)} joints below {clip.rig.joint_names[0]!r}, {len(clip.tracks)} keys")
    print(f"{times_s[-1]:g} s at {clip.fps:g} frames per second, solved from {clip.source_frames}")
    print(f"up axis {clip.up_axis}, {clip.meters_per_unit:g} m in a unit")

    most_moved = joint_that_moves_most(clip)
    print(f"{clip.rig.joint_names[most_moved]!r} moves most; its parent-local rotation wxyz:")
    for time_s, quat_wxyz in zip(times_s, clip.tracks.quats_wxyz[:, most_moved], strict=True):
        print(f"  {time_s:6.3f} s  {np.round(quat_wxyz, 4)}")

    # Any time will do, not only the keys.
    halfway = clip.pose_at(times_s[-1] / 2)
    shift = np.linalg.norm(halfway.positions - clip.splats.positions, axis=1)
    print(f"halfway, Gaussians are {shift.mean():.4g} units from rest on average")
    return clip


def joint_that_moves_most(clip: Clip) -> int:
    """Return the joint whose origin travels farthest from its first key."""
    origins = np.stack([clip.joint_matrices_at(time_s)[:, :3, 3] for time_s in clip.tracks.times_s])
    return int(np.linalg.norm(origins - origins[0], axis=-1).max(axis=0).argmax())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clip", metavar="CLIP", type=Path)
    main(parser.parse_args().clip)
