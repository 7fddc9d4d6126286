"""The energy terms of one frame, each one pure function.

Lengths enter as shares of the object's diagonal and pixel errors as shares of its size in the image, so that one
set of weights serves every object, unit and resolution. Images are compared over a black background and sums are
divided by the area of the target's silhouette, so that the empty part of a frame costs nothing.
"""

import torch

from animator import quaternions
from animator.deform.robust_norm import RobustNorm
from animator.types import AnchorPoses, Anchors

SQUARES = RobustNorm()
"""The plain sum of squares."""


def deformation_loss(
    projected_px: torch.Tensor,
    target_px: torch.Tensor,
    confidences: torch.Tensor,
    *,
    object_px: float,
    huber: float = 0.01,
) -> torch.Tensor:
    """Pull matched Gaussians to their pixels (paper Eq. 3), with a Huber norm against wrong matches.

    Args:
        projected_px: Where the matched Gaussians project now [px], shape (M, 2).
        target_px: Where they were seen [px], shape (M, 2).
        confidences: Trust in each match, shape (M,).
        object_px: Size of the object in the image [px], the unit of the error.
        huber: Error above which the norm grows linearly [share of the object].
    """
    if len(target_px) == 0:
        return projected_px.sum() * 0.0
    squared = ((projected_px - target_px) / object_px).square().sum(dim=1)
    distances = (squared + 1e-12).sqrt()
    norms = torch.where(distances < huber, 0.5 * squared / huber, distances - 0.5 * huber)
    return (confidences * norms).sum() / confidences.sum().clamp_min(1e-9)


def depth_loss(
    depths: torch.Tensor,
    target_depths: torch.Tensor,
    confidences: torch.Tensor,
    *,
    diagonal: float,
    huber: float = 0.01,
) -> torch.Tensor:
    """Pull visible Gaussians to the depths that the user's maps say, with a Huber norm against edges of the maps.

    Args:
        depths: Along the camera's +z now [scene unit], shape (M,).
        target_depths: What the map says [scene unit], shape (M,).
        confidences: Trust in each, shape (M,).
        diagonal: The object's diagonal [scene unit].
        huber: Error above which the norm grows linearly [diagonals].
    """
    distances = ((depths - target_depths) / diagonal).abs()
    norms = torch.where(
        distances < huber, 0.5 * distances.square() / huber, distances - 0.5 * huber
    )
    return (confidences * norms).sum() / confidences.sum().clamp_min(1e-9)


def group_loss(
    rest_offsets: torch.Tensor,
    rest_rotations_wxyz: torch.Tensor,
    posed_offsets: torch.Tensor,
    posed_rotations_wxyz: torch.Tensor,
    *,
    diagonal: float,
) -> torch.Tensor:
    """Keep rigid groups rigid (paper Eq. 4): mean over pairs i, j of one group.

    In the frame of Gaussian i, Gaussian j must stay where it was: R_i^-1 (mu_i - mu_j) is constant.

    Args:
        rest_offsets: mu_i - mu_j at rest [scene unit], shape (P, 3).
        rest_rotations_wxyz: Rotations of Gaussians i at rest, shape (P, 4).
        posed_offsets: mu'_i - mu'_j now [scene unit], shape (P, 3).
        posed_rotations_wxyz: Rotations of Gaussians i now, shape (P, 4).
        diagonal: The object's diagonal [scene unit].
    """
    if len(rest_offsets) == 0:
        return posed_offsets.sum() * 0.0
    rest = quaternions.rotate(quaternions.conjugate(rest_rotations_wxyz), rest_offsets)
    posed = quaternions.rotate(quaternions.conjugate(posed_rotations_wxyz), posed_offsets)
    return ((rest - posed) / diagonal).square().sum(dim=1).mean()


def arap_loss(
    anchors: Anchors, poses: AnchorPoses, *, diagonal: float, norm: RobustNorm = SQUARES
) -> torch.Tensor:
    """Let neighboring anchors move as rigidly as possible, relative to the rest pose (paper Eq. 5).

    Args:
        anchors: The rest pose.
        poses: The pose being solved.
        diagonal: The object's diagonal [scene unit], the unit of a residual.
        norm: What a residual costs; the paper's is the plain square.
    """
    first, second = anchors.edges.unbind(dim=1)
    if len(first) == 0:
        return poses.translations.sum() * 0.0
    rest = anchors.positions[first] - anchors.positions[second]
    posed = rest + poses.translations[first] - poses.translations[second]
    rotated = quaternions.rotate(poses.quats_wxyz[first], rest)
    squared = ((rotated - posed) / diagonal).square().sum(dim=1)
    return (anchors.edge_weights * norm.cost(squared)).mean()


def rotation_smoothness_loss(
    anchors: Anchors, poses: AnchorPoses, *, norm: RobustNorm = SQUARES
) -> torch.Tensor:
    """Let neighboring anchors turn alike: chordal distance of their rotations, |R_i - R_j|.

    Eq. 5 alone leaves a twist about an edge free. For unit quaternions
    |R_i - R_j|_F^2 = 8 (1 - (q_i . q_j)^2), which is 2 a^2 for a small angle a [rad].

    Args:
        anchors: The rest pose.
        poses: The pose being solved.
        norm: What a distance costs.
    """
    first, second = anchors.edges.unbind(dim=1)
    if len(first) == 0:
        return poses.quats_wxyz.sum() * 0.0
    cosines = (poses.quats_wxyz[first] * poses.quats_wxyz[second]).sum(dim=1)
    return (anchors.edge_weights * norm.cost(8.0 * (1.0 - cosines.square()))).mean()


def rgb_loss(rgb: torch.Tensor, target_rgb: torch.Tensor, *, area_px: float) -> torch.Tensor:
    """Compare colors (paper Eq. 6 with the absolute norm that its code uses): mean over the silhouette.

    Args:
        rgb: Rendered color on black, shape (H, W, 3).
        target_rgb: The frame times its coverage, shape (H, W, 3).
        area_px: Area of the target's silhouette [px].
    """
    return (rgb - target_rgb).abs().sum() / (3.0 * area_px)


def silhouette_loss(
    alpha: torch.Tensor, target_alpha: torch.Tensor, *, area_px: float
) -> torch.Tensor:
    """Compare coverage, so that an object of the background's color cannot hide. Shapes (H, W)."""
    return (alpha - target_alpha).abs().sum() / area_px


def coarse_image_loss(
    differences: torch.Tensor, *, area_px: float, cells_px: tuple[int, ...] = (4, 10)
) -> torch.Tensor:
    """Compare color and coverage averaged over cells: still has a slope where fine texture has none.

    Args:
        differences: Rendered minus target color and alpha, shape (H, W, 4).
        area_px: Area of the target's silhouette [px].
        cells_px: Sizes of the cells [px].
    """
    stacked = differences.permute(2, 0, 1)[None]
    total = stacked.new_zeros(())
    for cell in cells_px:
        pooled = torch.nn.functional.avg_pool2d(stacked, cell, ceil_mode=True)
        total = total + pooled.abs().sum() * cell**2
    return total / (3.0 * area_px)


def temporal_loss(
    poses: AnchorPoses, previous: AnchorPoses, *, diagonal: float, radius: float
) -> torch.Tensor:
    """Stay near the previous frame's pose, weakly: mean squared motion of the anchors' neighborhoods.

    Args:
        poses: The pose being solved.
        previous: The previous frame's.
        diagonal: The object's diagonal [scene unit].
        radius: Size of the neighborhood an anchor turns [scene unit]; makes a rotation a length.
    """
    moved = ((poses.translations - previous.translations) / diagonal).square().sum(dim=1)
    cosines = (poses.quats_wxyz * previous.quats_wxyz).sum(dim=1)
    turned = 8.0 * (1.0 - cosines.square()) * (radius / diagonal) ** 2
    return (moved + turned).mean()


def rest_loss(poses: AnchorPoses, *, diagonal: float, norm: RobustNorm) -> torch.Tensor:
    """Keep what has hardly moved where it was captured: one image says little along its rays.

    Args:
        poses: The pose being solved.
        diagonal: The object's diagonal [scene unit].
        norm: What a motion [diagonals] costs; a robust one lets go of what clearly moved.
    """
    squared = (poses.translations / diagonal).square().sum(dim=1)
    return norm.cost(squared).mean()
