"""The animated asset in memory: what every exporter writes and every test compares against."""

import dataclasses
import functools
from typing import TYPE_CHECKING, Literal

import numpy as np

from exporters.errors import ClipError

if TYPE_CHECKING:
    from exporters.posing import Poser


def _freeze(instance: object, **dtypes: type) -> None:
    """Replace the named array fields by contiguous read-only copies of the given type.

    Raises:
        ClipError: If a field is not an array of numbers, or integers are given as fractions.
    """
    for name, dtype in dtypes.items():
        given = getattr(instance, name)
        where = f"{type(instance).__name__}.{name}"
        try:
            array = np.array(given, dtype=dtype, order="C")
        except (TypeError, ValueError) as error:
            raise ClipError(f"{where}: expected an array of {dtype.__name__}, {error}") from error
        if np.issubdtype(dtype, np.integer) and not np.array_equal(array, np.asarray(given)):
            raise ClipError(f"{where}: expected whole numbers that fit {dtype.__name__}")
        array.flags.writeable = False
        object.__setattr__(instance, name, array)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Splats:
    """The Gaussians in the rest pose, activated."""

    positions: np.ndarray
    """Centers [scene unit], float32, shape (N, 3)."""
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

    def subset(self, rows: np.ndarray | slice) -> "Splats":
        """Return some of the Gaussians, chosen as rows of an array are."""
        fields = dataclasses.fields(self)
        return Splats(**{field.name: getattr(self, field.name)[rows] for field in fields})

    @property
    def sh_degree(self) -> int:
        """Degree of the spherical harmonics, 0..3."""
        return round(float(np.sqrt(self.sh_coeffs.shape[1]))) - 1


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
    """Joints of each Gaussian, int32, shape (N, 4); unused ones have joint 0 and weight 0."""
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
class Uncertainty:
    """How well the place of each joint was observed at each key: standard deviations.

    Small where the frame showed the joint, large where its place is a guess; 0 for what is given.
    """

    along_ray: np.ndarray
    """Along the viewing ray of the clip's camera [scene unit], >= 0, float32, shape (T, J)."""
    across_ray: np.ndarray
    """In a direction across that ray [scene unit], >= 0, float32, shape (T, J)."""

    def __post_init__(self) -> None:
        _freeze(self, along_ray=np.float32, across_ray=np.float32)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Posed:
    """The Gaussians at one moment."""

    positions: np.ndarray
    """Centers [scene unit], float32, shape (N, 3)."""
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
    uncertainty: Uncertainty | None = None
    fps: float = 24.0
    """Frames per second; key k lies at time code `times_s[k] * fps`."""
    up_axis: Literal["Y", "Z"] = "Y"
    meters_per_unit: float = 1.0
    source_frames: tuple[int, ...] = ()
    """Original frame number each key was solved from, -1 for an in-between, length T or 0."""

    def validate(self) -> None:
        """Check every promise the fields' docstrings make.

        Raises:
            ClipError: Listing all problems found, one a line.
        """
        from exporters.validation import find_problems  # imports the types above

        problems = find_problems(self)
        if problems:
            lines = "".join(f"\n  - {problem}" for problem in problems)
            raise ClipError(
                f"clip {self.name!r} is not usable, {len(problems)} problem(s) found:{lines}"
            )

    def bind_matrices(self) -> np.ndarray:
        """Return world-from-joint at rest, for column vectors, float64, shape (J, 4, 4)."""
        from exporters import posing

        return posing.world_matrices(self.rig, self.rig.rest_translations, self.rig.rest_quats_wxyz)

    def joint_matrices_at(self, time_s: float) -> np.ndarray:
        """Return world-from-joint at one time, for column vectors, float64, shape (J, 4, 4)."""
        from exporters import keyframes, posing

        return posing.world_matrices(self.rig, *keyframes.interpolate(self.tracks, time_s))

    def pose_at(self, time_s: float) -> Posed:
        """Pose the Gaussians: the truth that every exported file is compared with.

        Joint tracks are interpolated parent-locally (translations linearly, rotations by slerp
        along the shorter arc, as UsdSkel and glTF do), and held outside the keys. Centers follow
        linear blend skinning; rotations follow the normalized weighted sum of the joints'
        rest-to-posed rotations, applied on the left of the rest rotation.

        Joints are computed in float64, Gaussians in float32: a center is exact to a few roundings
        of its largest coordinate (about 3e-7 of it).

        Args:
            time_s: Time [s] on the clock of `tracks.times_s`.
        """
        return self._poser.pose(self.joint_matrices_at(time_s))

    @functools.cached_property
    def _poser(self) -> "Poser":
        """What posing prepares once; safe to keep, since nothing here ever changes."""
        from exporters.posing import Poser

        return Poser(self.splats, self.skin, self.bind_matrices())

    def extent_at(self, time_s: float) -> np.ndarray:
        """Return the box around the 3-sigma ellipsoids [scene unit], min and max, shape (2, 3)."""
        from exporters import bounds

        return bounds.Ellipsoids(self.splats.scales).extent(self.pose_at(time_s))
