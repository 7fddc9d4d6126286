"""Where the vertices of a clip's meshes must be, and how far a tool puts them from there."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from exporters import keyframes, posing, quaternions
from exporters.clip import Clip
from exporters.skinned_mesh import SkinnedMesh
from tests.helpers.playback import to_y_up_meters
from tests.tools.playing import PlayedMesh

Between = Literal["slerp", "lerp"]
"""How rotations go from key to key: on the arc, or, as in Blender, part by part along the chord."""


def expected_points(
    clip: Clip, mesh: SkinnedMesh, time_s: float, between: Between = "slerp"
) -> np.ndarray:
    """Skin a mesh by the clip's joints; return its vertices [m], Y-up, float64, shape (V, 3)."""
    if between == "slerp":
        world_from_joints = clip.joint_matrices_at(time_s)
    else:
        world_from_joints = posing.world_matrices(clip.rig, *_along_chords(clip, time_s))
    skin_matrices = world_from_joints @ np.linalg.inv(clip.bind_matrices())
    blended = np.einsum(
        "vk,vkab->vab", mesh.weights.astype(np.float64), skin_matrices[mesh.joint_ids]
    )
    points = np.einsum("vab,vb->va", blended[:, :3, :3], mesh.positions.astype(np.float64))
    points += blended[:, :3, 3]
    return to_y_up_meters(points, up_axis=clip.up_axis, meters_per_unit=clip.meters_per_unit)


def _along_chords(clip: Clip, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate translations, and rotations part by part, then normalized."""
    tracks = clip.tracks
    after = int(np.clip(np.searchsorted(tracks.times_s, time_s), 1, len(tracks.times_s) - 1))
    start_s, end_s = tracks.times_s[after - 1 : after + 1]
    share = np.clip((time_s - start_s) / (end_s - start_s), 0.0, 1.0)
    pairs = (tracks.translations, keyframes.continue_signs(tracks.quats_wxyz))
    translations, quats = ((1 - share) * keys[after - 1] + share * keys[after] for keys in pairs)
    return translations, quaternions.normalize(quats)


def moments(clip: Clip) -> tuple[list[float], list[float]]:
    """Return the clip's key times and the times half-way between them [s]."""
    keys = clip.tracks.times_s
    return keys.tolist(), ((keys[1:] + keys[:-1]) / 2).tolist()


def worst_error(
    clip: Clip,
    mesh: SkinnedMesh,
    played: PlayedMesh,
    times_s: Sequence[float],
    between: Between = "slerp",
) -> float:
    """Return the largest distance of a played vertex from where it must be, over the diagonal.

    Tools split and reorder vertices, so each is recognized by its place at rest; every vertex of
    the mesh must be found in the tool at least once.

    Args:
        clip: What was written.
        mesh: Which of its meshes, in the clip's axes and unit.
        played: The tool's vertices at `times_s`.
        times_s: Times [s].
        between: How the tool turns between keys.
    """
    rest = to_y_up_meters(
        mesh.positions.astype(np.float64),
        up_axis=clip.up_axis,
        meters_per_unit=clip.meters_per_unit,
    )
    diagonal = float(np.linalg.norm(np.ptp(rest, axis=0)))
    offsets, vertices = cKDTree(rest).query(played.rest)
    assert offsets.max() < 1e-5 * diagonal, "the tool moved vertices of the rest pose"
    assert len(np.unique(vertices)) == len(rest), "the tool lost vertices"
    assert len(played.posed) == len(times_s)
    errors = [
        np.linalg.norm(posed - expected_points(clip, mesh, time_s, between)[vertices], axis=1).max()
        for posed, time_s in zip(played.posed, times_s, strict=True)
    ]
    return float(max(errors)) / diagonal
