"""The Gaussians as a few rigid pieces: the motion that formats without a skin for splats can say."""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np

from exporters import bounds, keyframes, quaternions
from exporters.clip import Clip, Posed, Skin

ERROR_BOUND = 0.005
"""A piece is split while a twentieth of its Gaussians is farther off than this [diagonal]."""

_SAMPLED_SPLATS, _SAMPLED_FRAMES = 4096, 32  # enough to tell where to split
_SAMPLED_ERRORS = 4_000_000  # enough for a percentile
_FAINTEST = 1e-3  # what no one sees still moves, though it should not decide how


@dataclasses.dataclass(frozen=True, kw_only=True)
class MotionError:
    """How far rigid pieces are off, over all Gaussians and frames."""

    mean_percent: float
    """Mean distance of the centers [% of the diagonal]."""
    p95_percent: float
    """Its 95th percentile [% of the diagonal]."""
    max_percent: float
    """Its maximum [% of the diagonal]."""
    mean_degrees: float
    """Mean angle between the orientations."""
    p95_degrees: float
    max_degrees: float


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class RigidParts:
    """P rigid pieces at T frames; each Gaussian belongs to exactly one."""

    names: tuple[str, ...]
    """`part_3` for the rig's part 3, `part_3_0`, `part_3_1` where it was split, `free_0` for what
    is in no part of the rig."""
    members: tuple[np.ndarray, ...]
    """Indices of each piece's Gaussians, increasing."""
    origins: np.ndarray
    """Origin of each piece at rest, the mean of its centers [scene unit], shape (P, 3)."""
    times_s: np.ndarray
    """Times of the frames [s], shape (T,)."""
    translations: np.ndarray
    """Where the origins go [scene unit], shape (T, P, 3)."""
    quats_wxyz: np.ndarray
    """Rotations since rest about the origins, sign-continuous, shape (T, P, 4)."""
    error: MotionError
    """Against the exact motion."""


def fit_parts(clip: Clip) -> RigidParts:
    """Split the Gaussians into rigid pieces and find how each moves at best.

    A Gaussian goes with the part of its strongest joint. A part that bends is split by joints,
    between those that leave its rigid motion in opposite directions, until it is within
    `ERROR_BOUND` or one joint is left.

    At every whole time code each piece gets the rigid motion nearest to its Gaussians, centers and
    orientations, each weighted by its opacity.

    Args:
        clip: A valid clip.
    """
    joint_ids = clip.skin.joint_ids[np.arange(len(clip.splats)), clip.skin.weights.argmax(axis=1)]
    groups = list(_named_groups(clip, joint_ids))
    pieces = [_Piece.of(clip, np.flatnonzero(np.isin(joint_ids, joints))) for _, joints in groups]
    times_s = np.arange(keyframes.frame_count(clip)) / clip.fps
    translations = np.empty((len(times_s), len(pieces), 3))
    quats_wxyz = np.empty((len(times_s), len(pieces), 4))
    errors = _Errors(clip, frame_count=len(times_s))
    for frame, time_s in enumerate(times_s):
        posed = clip.pose_at(time_s)
        turns_wxyz = _turns(clip, posed)
        for index, piece in enumerate(pieces):
            positions, turns = posed.positions[piece.members], turns_wxyz[piece.members]
            rotation, origin = piece.fit(positions, turns)
            translations[frame, index] = origin
            quats_wxyz[frame, index] = quaternions.from_matrices(rotation)
            errors.add(
                piece.members,
                positions - (piece.local_centers @ rotation.T + origin),
                np.abs(turns @ quats_wxyz[frame, index]),
            )
        errors.finish_frame()
    return RigidParts(
        names=tuple(name for name, _ in groups),
        members=tuple(piece.members for piece in pieces),
        origins=np.array([piece.origin for piece in pieces]),
        times_s=times_s,
        translations=translations,
        quats_wxyz=keyframes.continue_signs(quats_wxyz),
        error=errors.summary(),
    )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Piece:
    """M Gaussians that are taken for rigid."""

    members: np.ndarray
    origin: np.ndarray
    local_centers: np.ndarray
    """At rest, from the origin, shape (M, 3)."""
    masses: np.ndarray
    """How much each counts; their sum is 1, shape (M,)."""
    turn_masses: np.ndarray
    """The same times the Gaussian's mean variance [scene unit ** 2], shape (M,)."""

    @classmethod
    def of(cls, clip: Clip, members: np.ndarray) -> "_Piece":
        splats = clip.splats
        masses = splats.opacities[members].astype(np.float64) + _FAINTEST
        masses /= masses.sum()
        centers = splats.positions[members].astype(np.float64)
        origin = masses @ centers
        variances = np.mean(splats.scales[members].astype(np.float64) ** 2, axis=1)
        return cls(
            members=members,
            origin=origin,
            local_centers=centers - origin,
            masses=masses,
            turn_masses=masses * variances,
        )

    def fit(self, positions: np.ndarray, turns_wxyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the best rotation and origin: a weighted Procrustes fit (Umeyama 1991, no scale).

        A Gaussian stands for its center and, as far as it spreads, for its orientation: the fit is
        that of points spread like the Gaussians, and needs no three centers.

        Args:
            positions: Posed centers, shape (..., M, 3).
            turns_wxyz: Rotations since rest, shape (..., M, 4).

        Returns:
            Rotation, shape (..., 3, 3), and posed origin, shape (..., 3).
        """
        origin = self.masses @ positions
        from_origin = (positions - origin[..., None, :]) * self.masses[:, None]
        covariance = from_origin.swapaxes(-1, -2) @ self.local_centers
        weighted = turns_wxyz * self.turn_masses[:, None]
        covariance += _summed_rotations(weighted.swapaxes(-1, -2) @ turns_wxyz)
        left, _, right = np.linalg.svd(covariance)
        left[..., :, 2] *= np.linalg.det(left @ right)[..., None]  # no reflection
        return left @ right, origin


def _summed_rotations(moments: np.ndarray) -> np.ndarray:
    """Return the weighted sum of rotation matrices, from that of `q q^T` (q as w, x, y, z)."""
    (ww, wx, wy, wz), (_, xx, xy, xz), (_, _, yy, yz), (_, _, _, zz) = np.moveaxis(
        moments, (-2, -1), (0, 1)
    )
    rows = [
        [ww + xx - yy - zz, 2 * (xy - wz), 2 * (xz + wy)],
        [2 * (xy + wz), ww - xx + yy - zz, 2 * (yz - wx)],
        [2 * (xz - wy), 2 * (yz + wx), ww - xx - yy + zz],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _turns(clip: Clip, posed: Posed) -> np.ndarray:
    """Return the rotation of each Gaussian since rest, shape (N, 4)."""
    return quaternions.multiply(posed.quats_wxyz, quaternions.conjugate(clip.splats.quats_wxyz))


def _named_groups(clip: Clip, joint_ids: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the pieces as joints, which lead some Gaussians each, with their names."""
    sample = _Sample.of(clip, joint_ids)
    leading = np.unique(joint_ids)
    part_ids = clip.rig.part_ids[leading]
    for part_id in np.unique(part_ids):
        groups = sorted(sample.split(leading[part_ids == part_id]), key=lambda joints: joints[0])
        name = f"part_{part_id}" if part_id >= 0 else "free"
        for index, joints in enumerate(groups):
            whole = len(groups) == 1 and part_id >= 0
            yield (name if whole else f"{name}_{index}"), joints


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Sample:
    """Some of the Gaussians at some of the frames."""

    clip: Clip
    """With these Gaussians only."""
    joint_ids: np.ndarray
    """Their strongest joints, shape (M,)."""
    positions: np.ndarray
    """Shape (F, M, 3)."""
    turns_wxyz: np.ndarray
    """Shape (F, M, 4)."""
    bound: float
    """[scene unit]."""

    @classmethod
    def of(cls, clip: Clip, joint_ids: np.ndarray) -> "_Sample":
        rows = slice(None, None, math.ceil(len(joint_ids) / _SAMPLED_SPLATS))
        skin = Skin(joint_ids=clip.skin.joint_ids[rows], weights=clip.skin.weights[rows])
        small = dataclasses.replace(clip, splats=clip.splats.subset(rows), skin=skin)
        last = keyframes.frame_count(clip) - 1
        codes = np.unique(np.linspace(0, last, min(last + 1, _SAMPLED_FRAMES)).astype(int))
        frames = [small.pose_at(code / clip.fps) for code in codes]
        return cls(
            clip=small,
            joint_ids=joint_ids[rows],
            positions=np.stack([posed.positions for posed in frames]),
            turns_wxyz=np.stack([_turns(small, posed) for posed in frames]),
            bound=ERROR_BOUND * bounds.diagonal(clip),
        )

    def split(self, joints: np.ndarray) -> list[np.ndarray]:
        """Split joints into groups that are rigid enough, each in increasing order."""
        members = np.flatnonzero(np.isin(self.joint_ids, joints))
        present = np.unique(self.joint_ids[members])
        if len(present) < 2:
            return [joints]
        piece = _Piece.of(self.clip, members)
        positions = self.positions[:, members]
        rotations, origins = piece.fit(positions, self.turns_wxyz[:, members])
        strays = positions - piece.local_centers @ rotations.swapaxes(1, 2) - origins[:, None]
        if np.quantile(np.linalg.norm(strays, axis=-1), 0.95) <= self.bound:
            return [joints]
        belongs = self.joint_ids[members] == present[:, None]
        means = (belongs / belongs.sum(axis=1, keepdims=True)) @ strays
        features = means.swapaxes(0, 1).reshape(len(present), -1)
        along = np.linalg.svd(features - features.mean(axis=0), full_matrices=False)[0][:, 0]
        is_first = along >= 0 if along[0] >= 0 else along < 0
        if is_first.all():  # all stray alike: by halves, then
            is_first = np.arange(len(present)) < len(present) // 2
        # Joints whose Gaussians were not sampled stay with the first.
        second = present[~is_first]
        return self.split(np.setdiff1d(joints, second)) + self.split(second)


class _Errors:
    """Gathers errors frame by frame; of long clips a sample, for the percentiles."""

    def __init__(self, clip: Clip, *, frame_count: int) -> None:
        count = len(clip.splats)
        self._percent = 100 / (bounds.diagonal(clip) or 1.0)
        self._stride = math.ceil(count * frame_count / _SAMPLED_ERRORS)
        self._frame = np.zeros((2, count))
        self._sums, self._largest = np.zeros(2), np.zeros(2)
        self._values, self._samples = 0, []

    def add(self, members: np.ndarray, strays: np.ndarray, cosines: np.ndarray) -> None:
        """Take what Gaussians are off: vectors, and cosines of half the angles."""
        self._frame[0, members] = np.linalg.norm(strays, axis=-1) * self._percent
        self._frame[1, members] = 2 * np.degrees(np.arccos(np.minimum(cosines, 1.0)))

    def finish_frame(self) -> None:
        """Count what was added since the last call."""
        self._sums += self._frame.sum(axis=1)
        self._largest = np.maximum(self._largest, self._frame.max(axis=1))
        self._values += self._frame.shape[1]
        self._samples.append(self._frame[:, :: self._stride].astype(np.float32))

    def summary(self) -> MotionError:
        """Return means, percentiles and maxima."""
        means = self._sums / self._values
        p95 = np.quantile(np.concatenate(self._samples, axis=1), 0.95, axis=1)
        return MotionError(
            mean_percent=float(means[0]),
            p95_percent=float(p95[0]),
            max_percent=float(self._largest[0]),
            mean_degrees=float(means[1]),
            p95_degrees=float(p95[1]),
            max_degrees=float(self._largest[1]),
        )
