"""Small clips whose motion can be worked out by hand, and one random clip for everything else."""

import dataclasses

import numpy as np

from exporters import quaternions
from exporters.clip import Clip, ClipCamera, Rig, Skin, Splats, Tracks, Uncertainty
from exporters.keyframes import continue_signs

SH_C0 = 0.28209479177387814
IDENTITY = (1.0, 0.0, 0.0, 0.0)
QUARTER_TURN_Z = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
"""+90 degrees about +z: x goes to y."""


def splats(positions: np.ndarray, *, sh_degree: int = 0, seed: int = 0) -> Splats:
    """Gaussians of clearly different axes, colors and opacities; unrotated."""
    rng = np.random.default_rng(seed)
    count = len(positions)
    sh_coeffs = np.zeros((count, (sh_degree + 1) ** 2, 3))
    sh_coeffs[:, 0] = (rng.uniform(0.1, 0.9, (count, 3)) - 0.5) / SH_C0
    sh_coeffs[:, 1:] = rng.normal(0.0, 0.2, (count, sh_coeffs.shape[1] - 1, 3))
    return Splats(
        positions=positions,
        quats_wxyz=np.tile(IDENTITY, (count, 1)),
        scales=np.tile([0.03, 0.02, 0.01], (count, 1)),
        opacities=np.linspace(0.2, 0.9, count),
        sh_coeffs=sh_coeffs,
    )


def skin_to(joint_ids: list[int]) -> Skin:
    """Each Gaussian follows one joint."""
    padded_ids = np.zeros((len(joint_ids), 4), np.int32)
    padded_ids[:, 0] = joint_ids
    return Skin(joint_ids=padded_ids, weights=np.tile([1.0, 0.0, 0.0, 0.0], (len(joint_ids), 1)))


def camera(*, moves_over_keys: int = 0) -> ClipCamera:
    """A camera that is symmetric in nothing: square no, centered no, level no.

    Args:
        moves_over_keys: Number of poses of a moving camera, 0 for a static one.
    """
    turn_wxyz = quaternions.normalize(np.array([0.9, 0.3, -0.2, 0.1]))
    poses = np.tile(np.eye(4), (max(moves_over_keys, 1), 1, 1))
    poses[:, :3, :3] = quaternions.to_matrices(turn_wxyz)
    poses[:, :3, 3] = [0.2, -0.1, 4.0]
    poses[:, 0, 3] += 0.25 * np.arange(len(poses))
    return ClipCamera(
        cam_from_world=poses,
        intrinsics=np.array([[700.0, 0.0, 301.5], [0.0, 650.0, 260.25], [0.0, 0.0, 1.0]]),
        width_px=640,
        height_px=480,
    )


def static() -> Clip:
    """Three Gaussians on the axes, one joint, one key: nothing moves."""
    rig = Rig(
        joint_names=("root",),
        parents=[-1],
        rest_translations=[[0.0, 0.0, 0.0]],
        rest_quats_wxyz=[IDENTITY],
        part_ids=[-1],
    )
    tracks = Tracks(times_s=[0.0], translations=[[[0.0, 0.0, 0.0]]], quats_wxyz=[[IDENTITY]])
    return Clip(
        name="static",
        splats=splats(np.eye(3)),
        rig=rig,
        skin=skin_to([0, 0, 0]),
        tracks=tracks,
        source_frames=(0,),
    )


def hinge() -> Clip:
    """A door: joint `door` hinged at (1, 0, 0) turns +90 degrees about +z in one second.

    Gaussian 0 at (0.5, 0, 0) follows the root. Gaussian 1 at (2, 0, 0) follows the door: it ends
    at (1, 1, 0), half-way at (1 + sqrt(1/2), sqrt(1/2), 0). Gaussian 2 at (1, 0, 0), on the hinge,
    half and half: it stays and ends turned by 45 degrees.
    """
    rig = Rig(
        joint_names=("root", "door"),
        parents=[-1, 0],
        rest_translations=[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
        rest_quats_wxyz=[IDENTITY, IDENTITY],
        part_ids=[0, 1],
    )
    tracks = Tracks(
        times_s=[0.0, 1.0],
        translations=np.tile(rig.rest_translations, (2, 1, 1)),
        quats_wxyz=[[IDENTITY, IDENTITY], [IDENTITY, QUARTER_TURN_Z]],
    )
    skin = Skin(
        joint_ids=[[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]],
        weights=[[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]],
    )
    return Clip(
        name="hinge",
        splats=splats(np.array([[0.5, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]])),
        rig=rig,
        skin=skin,
        tracks=tracks,
        camera=camera(),
        source_frames=(0, 24),
    )


def chain() -> Clip:
    """Three joints along +x, one unit apart; joints 1 and 2 both turn +90 degrees about +z.

    Keys at frames 0, 1, 3 of 24 a second: the second half-way (45 degrees each). Gaussians lie 0.5
    beyond their joint: (0.5, 0, 0), (1.5, 0, 0), (2.5, 0, 0); they end at (0.5, 0, 0), (1, 0.5, 0),
    (0.5, 1, 0). The camera moves by 0.25 a key.
    """
    eighth_turn = (np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8))
    rig = Rig(
        joint_names=("root", "elbow", "wrist"),
        parents=[-1, 0, 1],
        rest_translations=[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
        rest_quats_wxyz=[IDENTITY, IDENTITY, IDENTITY],
        part_ids=[0, 1, 2],
    )
    quats_wxyz = [[IDENTITY, turn, turn] for turn in (IDENTITY, eighth_turn, QUARTER_TURN_Z)]
    return Clip(
        name="chain",
        splats=splats(np.array([[0.5, 0.0, 0.0], [1.5, 0.0, 0.0], [2.5, 0.0, 0.0]])),
        rig=rig,
        skin=skin_to([0, 1, 2]),
        tracks=Tracks(
            times_s=np.array([0, 1, 3]) / 24,
            translations=np.tile(rig.rest_translations, (3, 1, 1)),
            quats_wxyz=quats_wxyz,
        ),
        camera=camera(moves_over_keys=3),
        source_frames=(10, -1, 12),
    )


def z_up_centimeters() -> Clip:
    """The hinge, said to be Z-up and in centimeters, with view-dependent color (SH degree 1).

    In Y-up meters Gaussian 1 starts at (0.02, 0, 0) and ends at (0.01, 0, -0.01).
    """
    clip = hinge()
    return dataclasses.replace(
        clip,
        name="hinge z cm",
        splats=splats(clip.splats.positions, sh_degree=1),
        up_axis="Z",
        meters_per_unit=0.01,
    )


def random(
    *, gaussians: int = 40, joints: int = 6, keys: int = 5, sh_degree: int = 3, seed: int = 7
) -> Clip:
    """A clip with nothing special: random tree, rotated rest poses, four influences, moving camera.

    Rotations between keys stay under 90 degrees; times are whole frames, not all present.
    """
    rng = np.random.default_rng(seed)
    names = ("root", *(f"joint {i}" for i in range(1, joints)))
    rig = Rig(
        joint_names=names,
        parents=[-1, *(int(rng.integers(0, i)) for i in range(1, joints))],
        rest_translations=rng.normal(0.0, 0.5, (joints, 3)),
        rest_quats_wxyz=_random_turns(rng, (joints,), 1.0),
        part_ids=rng.integers(-1, 3, joints),
    )
    codes = np.concatenate([[0], np.cumsum(rng.integers(1, 3, keys - 1))])
    steps = _random_turns(rng, (keys, joints), 0.3)
    quats_wxyz = quaternions.multiply(steps, rig.rest_quats_wxyz)
    weights = rng.dirichlet(np.ones(4), gaussians).astype(np.float32)
    joint_ids = np.stack([rng.permutation(joints)[:4] for _ in range(gaussians)])
    weights[: gaussians // 4, 2:] = 0.0
    joint_ids[: gaussians // 4, 2:] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    still = splats(rng.normal(0.0, 1.0, (gaussians, 3)), sh_degree=sh_degree, seed=seed)
    return Clip(
        name="random",
        splats=dataclasses.replace(
            still,
            quats_wxyz=_random_turns(rng, (gaussians,), 3.0),
            scales=rng.uniform(0.01, 0.08, (gaussians, 3)),
        ),
        rig=rig,
        skin=Skin(joint_ids=joint_ids, weights=weights),
        tracks=Tracks(
            times_s=codes / 24,
            translations=rig.rest_translations + rng.normal(0.0, 0.1, (keys, joints, 3)),
            quats_wxyz=continue_signs(quats_wxyz),
        ),
        camera=camera(moves_over_keys=keys),
        source_frames=tuple(int(code) for code in codes),
    )


def observed(clip: Clip) -> Clip:
    """Say how well each joint was observed: (key + 1) (joint + 1) hundredths along the ray, a fifth
    of it across."""
    keys, joints = np.indices(clip.tracks.quats_wxyz.shape[:2])
    along_ray = 0.01 * (keys + 1) * (joints + 1)
    uncertainty = Uncertainty(along_ray=along_ray, across_ray=along_ray / 5)
    return dataclasses.replace(clip, uncertainty=uncertainty)


def _random_turns(rng: np.random.Generator, shape: tuple[int, ...], spread: float) -> np.ndarray:
    """Unit quaternions near the identity: `spread` is the size of the imaginary part."""
    quats_wxyz = rng.normal(0.0, spread, (*shape, 4))
    quats_wxyz[..., 0] = 1.0
    return quaternions.normalize(quats_wxyz)


ALL = {
    "static": static,
    "hinge": hinge,
    "chain": chain,
    "z_up_centimeters": z_up_centimeters,
    "random": random,
}
"""Every clip above by name, to parametrize tests with."""
