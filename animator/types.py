"""The data that flows between the stages: frozen, keyword-only, activated.

Conventions everywhere in this package:

* quaternions are `wxyz`; rotations act on column vectors;
* cameras use OpenCV axes (+x right, +y down, +z forward) and pixel centres lie at +0.5;
* scales are linear standard deviations and opacities are in 0..1 (only `scene/ply.py` knows logs and logits);
* Gaussians are float32 torch on the renderer's device, anchors and poses float32 torch on the CPU;
  everything measured in images is numpy.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch

SOLID_OPACITY = 0.1
"""Gaussians below this opacity do not shape the object: no anchors, no extent."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Gaussians:
    """A set of N anisotropic Gaussians in world space."""

    means: torch.Tensor
    """Centres [scene unit], shape (N, 3)."""
    quats_wxyz: torch.Tensor
    """Unit rotations, shape (N, 4)."""
    scales: torch.Tensor
    """Standard deviations along the rotated axes [scene unit], > 0, shape (N, 3)."""
    opacities: torch.Tensor
    """Peak opacities in (0, 1), shape (N,)."""
    sh_coeffs: torch.Tensor
    """Raw spherical-harmonic colour coefficients, shape (N, K, 3), K in {1, 4, 9, 16}; colour = SH(direction) + 0.5."""

    def __len__(self) -> int:
        return len(self.means)

    @property
    def diagonal(self) -> float:
        """Length of the object's bounding-box diagonal [scene unit], deaf to stray and faint Gaussians."""
        solid = self.means[self.opacities > SOLID_OPACITY]
        points = (solid if len(solid) else self.means).detach().cpu().numpy()
        low, high = np.percentile(points, [0.5, 99.5], axis=0)
        return max(float(np.linalg.norm(high - low)), 1e-12)

    def to(self, device: torch.device) -> "Gaussians":
        """Return the same Gaussians on another device."""
        fields = dataclasses.fields(self)
        return Gaussians(**{field.name: getattr(self, field.name).to(device) for field in fields})

    def posed(self, means: torch.Tensor, quats_wxyz: torch.Tensor) -> "Gaussians":
        """Return the same Gaussians at other centres and rotations."""
        return dataclasses.replace(self, means=means, quats_wxyz=quats_wxyz)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Camera:
    """A pinhole camera."""

    cam_from_world: np.ndarray
    """World to camera, OpenCV axes, float64, shape (4, 4)."""
    intrinsics: np.ndarray
    """Pinhole matrix [px], pixel centres at +0.5, float64, shape (3, 3)."""
    width_px: int
    """Image width [px]."""
    height_px: int
    """Image height [px]."""
    name: str = ""
    """Where the camera comes from, for messages: usually the image's file name."""

    @property
    def position(self) -> np.ndarray:
        """Camera centre in world space [scene unit], shape (3,)."""
        rotation, translation = self.cam_from_world[:3, :3], self.cam_from_world[:3, 3]
        return -rotation.T @ translation

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project world points.

        Args:
            points: World positions [scene unit], shape (M, 3).

        Returns:
            Pixel positions (pixel centres at +0.5), shape (M, 2), and depths along +z [scene unit], shape (M,).
        """
        in_camera = points @ self.cam_from_world[:3, :3].T + self.cam_from_world[:3, 3]
        depths = in_camera[:, 2]
        safe = np.where(np.abs(depths) < 1e-9, 1e-9, depths)
        homogeneous = in_camera @ self.intrinsics.T
        return homogeneous[:, :2] / safe[:, None], depths

    def cropped(self, left_px: int, top_px: int, width_px: int, height_px: int) -> "Camera":
        """Return the camera of a window of the image."""
        intrinsics = self.intrinsics.copy()
        intrinsics[:2, 2] -= (left_px, top_px)
        return dataclasses.replace(
            self, intrinsics=intrinsics, width_px=width_px, height_px=height_px
        )

    def halved(self) -> "Camera":
        """Return the camera of the image at half its size; an odd last row or column is left out."""
        intrinsics = self.intrinsics.copy()
        intrinsics[:2] /= 2.0
        return dataclasses.replace(
            self, intrinsics=intrinsics, width_px=self.width_px // 2, height_px=self.height_px // 2
        )

    def with_pose(self, cam_from_world: np.ndarray) -> "Camera":
        """Return the same lens at another pose."""
        return dataclasses.replace(self, cam_from_world=np.asarray(cam_from_world, np.float64))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Frames:
    """The clip to animate: T images of one size, in order."""

    images: np.ndarray
    """sRGB, straight (not premultiplied), uint8, shape (T, H, W, 3)."""
    alphas: np.ndarray
    """Foreground coverage, uint8 0..255, shape (T, H, W)."""
    numbers: tuple[int, ...]
    """The original frame numbers, strictly increasing, length T."""
    names: tuple[str, ...]
    """File names (or `video.mp4#12`), for messages, length T."""
    fps: float
    """Frames per second."""
    depths: np.ndarray | None = None
    """What a depth camera or network says of each frame, near small or near large, on one unknown scale; NaN where it
    says nothing, float32, shape (T, H, W); None if there is none."""

    def __len__(self) -> int:
        return len(self.images)

    def take(self, indices: Sequence[int]) -> "Frames":
        """Return the frames at the given positions, in that order."""
        index = list(indices)
        return dataclasses.replace(
            self,
            images=self.images[index],
            alphas=self.alphas[index],
            depths=None if self.depths is None else self.depths[index],
            numbers=tuple(self.numbers[i] for i in index),
            names=tuple(self.names[i] for i in index),
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Matches:
    """Pixel correspondences from a source image to a target image."""

    source_px: np.ndarray
    """Positions in the source image, pixel centres at +0.5, float32, shape (M, 2)."""
    target_px: np.ndarray
    """Positions in the target image, pixel centres at +0.5, float32, shape (M, 2)."""
    confidences: np.ndarray
    """Trust in each match, 0..1, float32, shape (M,)."""

    def __len__(self) -> int:
        return len(self.source_px)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class GaussianMatches:
    """Gaussian-to-pixel correspondences: where in the frame each matched Gaussian should project."""

    gaussian_ids: np.ndarray
    """Indices of Gaussians, each at most once, int64, shape (M,)."""
    target_px: np.ndarray
    """Pixel position in the frame, pixel centres at +0.5, float64, shape (M, 2)."""
    confidences: np.ndarray
    """Trust in each match, 0..1, float64, shape (M,)."""

    def __len__(self) -> int:
        return len(self.gaussian_ids)

    def take(self, which: np.ndarray) -> "GaussianMatches":
        """Return some of them: indices, or a boolean of shape (M,)."""
        return GaussianMatches(
            gaussian_ids=self.gaussian_ids[which],
            target_px=self.target_px[which],
            confidences=self.confidences[which],
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class GaussianDepths:
    """How far some Gaussians are from the camera of a frame, by the user's depth maps."""

    gaussian_ids: np.ndarray
    """Indices of the Gaussians, int64, shape (M,)."""
    depths: np.ndarray
    """Along the camera's +z [scene unit], shape (M,)."""
    confidences: np.ndarray
    """Trust in each depth, 0..1, shape (M,)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Anchors:
    """The control points of the deformation, fixed in the rest pose for the whole clip."""

    positions: torch.Tensor
    """Rest positions [scene unit], shape (A, 3)."""
    spacing: float
    """Voxel size the anchors were averaged over [scene unit]."""
    skin_ids: torch.Tensor
    """The anchors each Gaussian follows, int32, shape (N, 4)."""
    skin_weights: torch.Tensor
    """Their weights, >= 0, rows sum to 1, no anchor twice with positive weight, shape (N, 4)."""
    edges: torch.Tensor
    """Directed neighbour pairs (i, j) of the anchor graph, both directions present, int64, shape (E, 2)."""
    edge_weights: torch.Tensor
    """Weight of each edge, mean 1, shape (E,)."""

    def __len__(self) -> int:
        return len(self.positions)

    def carrying(self, chosen: np.ndarray | slice) -> "Anchors":
        """Return the same anchors with the skinning weights of chosen Gaussians only, in the order chosen."""
        return dataclasses.replace(
            self,
            skin_ids=self.skin_ids[chosen].contiguous(),
            skin_weights=self.skin_weights[chosen].contiguous(),
        )

    def mean_of_carried(self, values: np.ndarray) -> np.ndarray:
        """Average a value of each Gaussian, shape (N,), over those that follow an anchor, by weight; shape (A,)."""
        ids = self.skin_ids.cpu().numpy().ravel()
        weights = self.skin_weights.detach().cpu().numpy().astype(np.float64)
        sums, totals = (
            np.bincount(ids, part.ravel(), minlength=len(self))
            for part in (weights * values[:, None], weights)
        )
        return sums / np.maximum(totals, 1e-12)

    def blended(self, values: np.ndarray) -> np.ndarray:
        """Average a value of each anchor, shape (A,), over those that a Gaussian follows, by weight; shape (N,)."""
        weights = self.skin_weights.detach().cpu().numpy()
        return (weights * values[self.skin_ids.cpu().numpy()]).sum(axis=1)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class AnchorPoses:
    """One pose of all anchors: a rest point x near anchor k goes to R_k (x - a_k) + a_k + T_k (paper Eq. 2)."""

    quats_wxyz: torch.Tensor
    """Rotations R_k from rest, unit, shape (A, 4)."""
    translations: torch.Tensor
    """Translations T_k from rest [scene unit], shape (A, 3)."""

    @classmethod
    def identity(cls, anchors: Anchors) -> "AnchorPoses":
        """Return the rest pose."""
        quats = torch.zeros(len(anchors), 4)
        quats[:, 0] = 1.0
        return cls(quats_wxyz=quats, translations=torch.zeros_like(anchors.positions))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class AnchorUncertainty:
    """How well one frame shows where each anchor is: standard deviations, large where it is a guess."""

    along_ray: np.ndarray
    """Along the viewing ray [scene unit], > 0, float32, shape (A,)."""
    across_ray: np.ndarray
    """In a direction across the viewing ray [scene unit], > 0, float32, shape (A,)."""

    def or_larger(self, other: "AnchorUncertainty") -> "AnchorUncertainty":
        """Return the larger of both, anchor by anchor: what is known of a moment between two frames."""
        return AnchorUncertainty(
            along_ray=np.maximum(self.along_ray, other.along_ray),
            across_ray=np.maximum(self.across_ray, other.across_ray),
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class RigidGroups:
    """Rigid parts of the object."""

    labels: np.ndarray
    """Group of each Gaussian, -1 for none, int64, shape (N,)."""

    @property
    def count(self) -> int:
        """Number of groups."""
        return int(self.labels.max(initial=-1)) + 1
