"""Draw the README's picture from a finished run of the example.

Top: frames of the clip. Middle: the animated splat from a side that was never filmed. Bottom: the
same in the colors of the rigid parts that the joints belong to.

Usage:
    python docs/make_strip.py out/clip.splatimate.npz docs/desk_lamp.png
"""

import argparse
import dataclasses
from pathlib import Path

import cv2
import numpy as np
import torch

from animator.render.cpu import CpuRenderer
from animator.report.palette import group_colors
from animator.types import Camera, Gaussians
from exporters import load_clip
from exporters.clip import Clip

COLUMN_COUNT = 5
TURN_DEG = 50.0
"""From the filming camera to the side view, about the world's up axis."""
_SH_C0 = 0.28209479177387814


def main(clip_path: Path, frames_folder: Path, picture_path: Path) -> None:
    """Draw and write the picture."""
    clip = load_clip(clip_path)
    if clip.camera is None:
        raise SystemExit(f"{clip_path}: holds no camera")
    frame_paths = sorted(frames_folder.glob("*.png"))
    keys = np.linspace(0, len(clip.tracks) - 1, COLUMN_COUNT).round().astype(int)
    filmed = Camera(
        cam_from_world=clip.camera.cam_from_world[0],
        intrinsics=clip.camera.intrinsics,
        width_px=clip.camera.width_px,
        height_px=clip.camera.height_px,
    )
    side = turned(filmed, clip.splats.positions.mean(axis=0), TURN_DEG)
    part_coeffs = part_colors(clip)
    columns = []
    for key in keys:
        frame = cv2.imread(str(frame_paths[clip.source_frames[key]]), cv2.IMREAD_UNCHANGED)
        alpha = frame[:, :, 3:] / 255
        gaussians = posed_gaussians(clip, float(clip.tracks.times_s[key]))
        painted = dataclasses.replace(gaussians, sh_coeffs=part_coeffs)
        rows = [
            frame[:, :, :3] * alpha + 255 * (1 - alpha),
            drawn(gaussians, side),
            drawn(painted, side),
        ]
        columns.append(np.vstack(rows))
    strip = np.hstack(columns).round().astype(np.uint8)
    cv2.imwrite(str(picture_path), strip, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def posed_gaussians(clip: Clip, time_s: float) -> Gaussians:
    """Return the Gaussians at one time."""
    posed, splats = clip.pose_at(time_s), clip.splats
    fields = (posed.positions, posed.quats_wxyz, splats.scales, splats.opacities, splats.sh_coeffs)
    means, quats_wxyz, scales, opacities, sh_coeffs = (torch.tensor(field) for field in fields)
    return Gaussians(
        means=means,
        quats_wxyz=quats_wxyz,
        scales=scales,
        opacities=opacities,
        sh_coeffs=sh_coeffs,
    )


def part_colors(clip: Clip) -> torch.Tensor:
    """Return SH coefficients of degree 0: a color a rigid part, blended by the skin's weights."""
    colors_of_joints = group_colors(clip.rig.part_ids)
    colors = np.einsum("nk,nkc->nc", clip.skin.weights, colors_of_joints[clip.skin.joint_ids])
    return torch.tensor((colors - 0.5) / _SH_C0, dtype=torch.float32)[:, None]


def turned(camera: Camera, center: np.ndarray, angle_deg: float) -> Camera:
    """Carry a camera around a vertical axis through a point."""
    cosine, sine = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    turn = np.eye(4)
    turn[:3, :3] = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    turn[:3, 3] = center - turn[:3, :3] @ center
    return camera.with_pose(camera.cam_from_world @ np.linalg.inv(turn))


def drawn(gaussians: Gaussians, camera: Camera) -> np.ndarray:
    """Draw on white, BGR 0..255, shape (H, W, 3)."""
    picture = CpuRenderer().render(gaussians, camera, background=(1.0, 1.0, 1.0))
    return 255 * picture.rgb.clamp(0.0, 1.0).numpy()[:, :, ::-1]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clip", metavar="CLIP", type=Path)
    parser.add_argument("picture", metavar="PNG", type=Path)
    default_frames = Path(__file__).parent.parent / "examples" / "desk_lamp" / "frames"
    parser.add_argument("--frames", metavar="FOLDER", type=Path, default=default_frames)
    arguments = parser.parse_args()
    main(arguments.clip, arguments.frames, arguments.picture)
