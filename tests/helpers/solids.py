"""Clips whose Gaussians lie flat on solids of a known shape."""

import numpy as np

from exporters.clip import Clip, Rig, Skin, Splats, Tracks
from tests.helpers import clips


def ball(
    center: tuple[float, float, float] = (0.0, 0.0, 0.0), radius: float = 1.0, count: int = 800
) -> Splats:
    """Disks on a sphere, evenly spread (Fibonacci lattice), that overlap into a closed skin."""
    heights = 1 - (2 * np.arange(count) + 1) / count
    angles = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - heights**2)
    normals = np.stack([flat * np.cos(angles), flat * np.sin(angles), heights], axis=1)
    # The half-way turn from +z to the normal; no normal is exactly -z.
    quats_wxyz = np.stack(
        [1 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(count)], axis=1
    )
    quats_wxyz /= np.linalg.norm(quats_wxyz, axis=1, keepdims=True)
    spacing = radius * np.sqrt(4 * np.pi / count)
    return Splats(
        positions=np.array(center) + radius * normals,
        quats_wxyz=quats_wxyz,
        scales=np.tile([0.6 * spacing, 0.6 * spacing, 0.1 * spacing], (count, 1)),
        opacities=np.full(count, 0.9),
        sh_coeffs=np.tile([0.5, -0.5, 1.0], (count, 1, 1)),
    )


def joined(*parts: Splats) -> Splats:
    """All Gaussians of several."""
    fields = ("positions", "quats_wxyz", "scales", "opacities", "sh_coeffs")
    return Splats(**{f: np.concatenate([getattr(part, f) for part in parts]) for f in fields})


def chosen(splats: Splats, which: np.ndarray) -> Splats:
    """Some of the Gaussians."""
    fields = ("positions", "quats_wxyz", "scales", "opacities", "sh_coeffs")
    return Splats(**{field: getattr(splats, field)[which] for field in fields})


def clip_of(splats: Splats, skin: Skin | None = None, joints: int = 1) -> Clip:
    """Gaussians on a rig of `joints` joints in a row; the last turns by 90 degrees about +z."""
    rig = Rig(
        joint_names=tuple(f"joint {i}" for i in range(joints)),
        parents=[-1] + [0] * (joints - 1),
        rest_translations=np.zeros((joints, 3)),
        rest_quats_wxyz=np.tile(clips.IDENTITY, (joints, 1)),
        part_ids=np.full(joints, -1),
    )
    quats_wxyz = np.tile(clips.IDENTITY, (2, joints, 1))
    quats_wxyz[1, -1] = clips.QUARTER_TURN_Z
    return Clip(
        name="solid",
        splats=splats,
        rig=rig,
        skin=skin or clips.skin_to([0] * len(splats)),
        tracks=Tracks(
            times_s=[0.0, 1.0], translations=np.zeros((2, joints, 3)), quats_wxyz=quats_wxyz
        ),
    )
