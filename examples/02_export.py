"""Make a clip by hand and write it in every format; needs numpy, usd-core and pygltflib, no torch.

The clip is a door: two joints, twelve Gaussians, one quarter turn. Anything that can fill a `Clip`
(a simulation, a game, another tracker) gets the exporters for free.

Usage:
    python examples/02_export.py OUT_FOLDER
"""

import argparse
import dataclasses
from pathlib import Path

import numpy as np

from exporters import PROFILES, Clip, Rig, Skin, Splats, Tracks, export_clip, save_clip

GAUSSIAN_COUNT = 12
IDENTITY_WXYZ = (1.0, 0.0, 0.0, 0.0)
QUARTER_TURN_WXYZ = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
"""About +y, the hinge."""


def door() -> Clip:
    """Return a row of Gaussians from the hinge at x = 0 to x = 1.1; the first does not turn."""
    positions = np.zeros((GAUSSIAN_COUNT, 3))
    positions[:, 0] = 0.1 * np.arange(GAUSSIAN_COUNT)
    joint_ids = np.zeros((GAUSSIAN_COUNT, 4), np.int32)
    joint_ids[1:, 0] = 1
    rig = Rig(
        joint_names=("frame", "door"),
        parents=[-1, 0],
        rest_translations=np.zeros((2, 3)),
        rest_quats_wxyz=[IDENTITY_WXYZ, IDENTITY_WXYZ],
        part_ids=[0, 1],
    )
    return Clip(
        name="door",
        splats=Splats(
            positions=positions,
            quats_wxyz=np.tile(IDENTITY_WXYZ, (GAUSSIAN_COUNT, 1)),
            scales=np.tile([0.05, 0.2, 0.01], (GAUSSIAN_COUNT, 1)),
            opacities=np.full(GAUSSIAN_COUNT, 0.9),
            sh_coeffs=np.linspace(-1.0, 1.0, 3 * GAUSSIAN_COUNT).reshape(GAUSSIAN_COUNT, 1, 3),
        ),
        rig=rig,
        skin=Skin(joint_ids=joint_ids, weights=np.tile([1.0, 0.0, 0.0, 0.0], (GAUSSIAN_COUNT, 1))),
        tracks=Tracks(
            times_s=[0.0, 1.0],
            translations=np.zeros((2, 2, 3)),
            quats_wxyz=[[IDENTITY_WXYZ, IDENTITY_WXYZ], [IDENTITY_WXYZ, QUARTER_TURN_WXYZ]],
        ),
    )


def main(out_folder: Path) -> tuple[Path, ...]:
    """Write the door; return the files."""
    out_folder.mkdir(parents=True, exist_ok=True)
    clip = door()
    clip.validate()
    written = save_clip(clip, out_folder / "door.splatimate.npz")
    for name in ("door.usda", "door.glb", "door_gaussians.usdc", "door_gaussians"):
        written += export_clip(clip, out_folder / name)
    # For one tool: its profile, and what you want otherwise.
    for_unreal = dataclasses.replace(PROFILES["unreal"].options, mesh="quads")
    written += export_clip(clip, out_folder / "door_unreal.usdc", for_unreal)
    print(f"{len(written)} files, the first: {written[0]}")
    return written


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out_folder", metavar="OUT_FOLDER", type=Path)
    main(parser.parse_args().out_folder)
