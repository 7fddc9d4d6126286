"""The animated asset in memory: what every exporter writes and every test compares against."""

import dataclasses
from typing import Literal

import numpy as np

from exporters import quaternions
from exporters.errors import ClipError


def _freeze(instance: object, **dtypes: type) -> None:
    """Replace the named array fields by contiguous read-only copies of the given type."""
    for name, dtype in dtypes.items():
        array = np.array(getattr(instance, name), dtype=dtype, order="C")
        array.flags.writeable = False
        object.__setattr__(instance, name, array)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Splats:
    """The Gaussians in the rest pose, activated."""

    positions: np.ndarray
    """Centres [scene unit], float32, shape (N, 3)."""
    quats_wxyz: np.ndarray
    """Unit rotations, float32, shape (N, 4)."""
    scales: np.ndarray
    """Linear standard deviations [scene unit], > 0, float32, shape (N, 3)."""
    opacities: np.ndarray
    """Opacities in 0..1, float32, shape (N,)."""
    sh_coeffs: np.ndarray
    """Raw spherical-harmonic coefficients, float32, shape (N, K, 3), K in {1, 4, 9, 16}."""

    def __post_init__(self) -> None:
        _freeze(
            self,
            positions=np.float32,
            quats_wxyz=np.float32,
            scales=np.float32,
            opacities=np.float32,
            sh_coeffs=np.float32,
        )

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def sh_degree(self) -> int:
        """Degree of the spherical harmonics, 0..3."""
        return int(round(np.sqrt(self.sh_coeffs.shape[1]))) - 1


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Rig:
    """A tree of joints with one root."""

    joint_names: tuple[str, ...]
    """Unique names, parents before children, length J."""
    parents: np.ndarray
    """Index of each joint's parent, -1 for the root (joint 0), int32, shape (J,)."""
    rest_translations: np.ndarray
    """Parent-local rest translations [scene unit], float64, shape (J, 3)."""
    rest_quats_wxyz: np.ndarray
    """Parent-local rest rotations, unit, float64, shape (J, 4)."""
    part_ids: np.ndarray
    """Rigid part each joint belongs to, -1 for none, int32, shape (J,)."""

    def __post_init__(self) -> None:
        _freeze(
            self,
            parents=np.int32,
            rest_translations=np.float64,
            rest_quats_wxyz=np.float64,
            part_ids=np.int32,
        )

    def __len__(self) -> int:
        return len(self.joint_names)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Skin:
    """Which joints each Gaussian follows."""

    joint_ids: np.ndarray
    """Joints of each Gaussian, int32, shape (N, 4); an unused influence has joint 0 and weight 0."""
    weights: np.ndarray
    """Weights, >= 0, rows sum to 1, no joint twice with positive weight, float32, shape (N, 4)."""

    def __post_init__(self) -> None:
        _freeze(self, joint_ids=np.int32, weights=np.float32)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Tracks:
    """The motion: parent-local joint transforms at each key."""

    times_s: np.ndarray
    """Key times [s], strictly increasing from 0, float64, shape (T,)."""
    translations: np.ndarray
    """Parent-local translations [scene unit], float64, shape (T, J, 3)."""
    quats_wxyz: np.ndarray
    """Parent-local rotations, unit, sign-continuous in time, float64, shape (T, J, 4)."""

    def __post_init__(self) -> None:
        _freeze(self, times_s=np.float64, translations=np.float64, quats_wxyz=np.float64)

    def __len__(self) -> int:
        return len(self.times_s)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ClipCamera:
    """The camera the clip was filmed with."""

    cam_from_world: np.ndarray
    """World to camera, OpenCV axes, float64, shape (T, 4, 4), or (1, 4, 4) for a static camera."""
    intrinsics: np.ndarray
    """Pinhole matrix [px], pixel centres at +0.5, float64, shape (3, 3)."""
    width_px: int
    """Image width [px]."""
    height_px: int
    """Image height [px]."""

    def __post_init__(self) -> None:
        _freeze(self, cam_from_world=np.float64, intrinsics=np.float64)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Posed:
    """The Gaussians at one moment."""

    positions: np.ndarray
    """Centres [scene unit], float32, shape (N, 3)."""
    quats_wxyz: np.ndarray
    """Unit rotations, float32, shape (N, 4)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Clip:
    """A rigged, animated set of Gaussians."""

    name: str
    """Name of the asset; becomes the root prim or node."""
    splats: Splats
    rig: Rig
    skin: Skin
    tracks: Tracks
    camera: ClipCamera | None = None
    fps: float = 24.0
    """Frames per second; key k lies at time code `times_s[k] * fps`."""
    up_axis: Literal["Y", "Z"] = "Y"
    meters_per_unit: float = 1.0
    source_frames: tuple[int, ...] = ()
    """Original number of the frame each key was solved from, -1 for an in-between, length T or 0."""
