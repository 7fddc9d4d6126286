"""A large clip made of numbers alone, for the benchmarks of the exporters."""

import numpy as np

from exporters.clip import Clip, Rig, Skin, Splats, Tracks
from exporters.quaternions import normalize

FPS = 24.0


def synthetic_clip(*, gaussians: int, frames: int, joints: int, seed: int = 0) -> Clip:
    """Flat Gaussians on a bumpy sphere, waved by joints below one root, with harmonics."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(gaussians, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    positions = normals * (1 + 0.15 * np.sin(4 * normals[:, :1]) * np.cos(3 * normals[:, 1:2]))
    anchors = positions[rng.permutation(gaussians)[: joints - 1]]
    nearest = np.concatenate([_nearest(part, anchors) for part in np.array_split(positions, 100)])
    distances = np.linalg.norm(positions[:, None] - anchors[nearest], axis=2)
    weights = np.exp(-distances / distances.mean())

    times_s = np.arange(frames) / FPS
    phases = rng.uniform(0, 2 * np.pi, (joints, 3))
    waves = np.sin(rng.uniform(0.5, 2.0, (joints, 1)) * times_s[:, None, None] + phases)
    waves[:, 0] = 0  # the root stands still
    rest = np.concatenate([np.zeros((1, 3)), anchors])
    half_turns = np.concatenate([np.ones((frames, joints, 1)), 0.2 * waves[..., ::-1]], axis=2)
    return Clip(
        name="synthetic",
        splats=Splats(
            positions=positions,
            quats_wxyz=normalize(rng.normal(size=(gaussians, 4))),
            scales=np.array([0.01, 0.01, 0.002]) * np.exp(rng.normal(0, 0.3, (gaussians, 3))),
            opacities=rng.uniform(0.05, 0.99, gaussians),
            sh_coeffs=rng.normal(0, 0.2, (gaussians, 16, 3)),
        ),
        rig=Rig(
            joint_names=("root", *(f"joint_{index:03d}" for index in range(1, joints))),
            parents=[-1, *[0] * (joints - 1)],
            rest_translations=rest,
            rest_quats_wxyz=np.tile([1.0, 0, 0, 0], (joints, 1)),
            part_ids=np.full(joints, -1),
        ),
        skin=Skin(joint_ids=nearest + 1, weights=weights / weights.sum(axis=1, keepdims=True)),
        tracks=Tracks(
            times_s=times_s, translations=rest + 0.1 * waves, quats_wxyz=normalize(half_turns)
        ),
        fps=FPS,
    )


def _nearest(points: np.ndarray, anchors: np.ndarray) -> np.ndarray:
    """Return the four nearest anchors of each point, shape (M, 4)."""
    squares = ((points[:, None] - anchors) ** 2).sum(axis=2)
    return np.argsort(squares, axis=1, kind="stable")[:, :4]
