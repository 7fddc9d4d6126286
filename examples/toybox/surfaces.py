"""Pieces of surface that can be sampled evenly: rectangle, tube, disk and ball."""

import dataclasses
from collections.abc import Callable
from typing import Protocol

import numpy as np

Pattern = Callable[[np.ndarray], np.ndarray]
"""Maps places on a surface [scene unit], shape (M, 2), to sRGB colors 0..1, shape (M, 3)."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SurfacePoints:
    """Points on a surface."""

    positions: np.ndarray
    """Places in the part's frame [scene unit], shape (M, 3)."""
    normals: np.ndarray
    """Outward unit normals, shape (M, 3)."""
    surface_xy: np.ndarray
    """Places on the unrolled surface [scene unit], for patterns, shape (M, 2)."""


class Shape(Protocol):
    """A piece of surface that turns evenly distributed numbers into evenly distributed points."""

    @property
    def area(self) -> float:
        """Area [scene unit squared]."""
        ...

    def at(self, uv: np.ndarray) -> SurfacePoints:
        """Map the unit square to the surface so that equal areas stay equal.

        Args:
            uv: Numbers in 0..1, shape (M, 2).
        """
        ...


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Rectangle:
    """A flat face; its outside is where `right` x `up` points."""

    center: np.ndarray
    right: np.ndarray
    """Full width as a vector [scene unit], shape (3,)."""
    up: np.ndarray
    """Full height as a vector [scene unit], shape (3,)."""

    @property
    def area(self) -> float:
        """Area [scene unit squared]."""
        return float(np.linalg.norm(np.cross(self.right, self.up)))

    def at(self, uv: np.ndarray) -> SurfacePoints:
        """See `Shape.at`."""
        centered = uv - 0.5
        normal = np.cross(self.right, self.up) / self.area
        size = np.array([np.linalg.norm(self.right), np.linalg.norm(self.up)])
        return SurfacePoints(
            positions=self.center + centered @ np.stack([self.right, self.up]),
            normals=np.tile(normal, (len(uv), 1)),
            surface_xy=centered * size,
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Tube:
    """The side of a cylinder or of a truncated cone about +y, unrolled from angle 0 (towards +x)."""

    bottom_radius: float
    top_radius: float
    bottom_y: float
    top_y: float
    faces_inward: bool = False

    @property
    def area(self) -> float:
        """Area [scene unit squared]."""
        slant = np.hypot(self.top_radius - self.bottom_radius, self.top_y - self.bottom_y)
        return float(np.pi * (self.bottom_radius + self.top_radius) * slant)

    def at(self, uv: np.ndarray) -> SurfacePoints:
        """See `Shape.at`."""
        angles = 2 * np.pi * uv[:, 0]
        # Area grows with the square of the radius along a cone.
        squares = self.bottom_radius**2 * (1 - uv[:, 1]) + self.top_radius**2 * uv[:, 1]
        radii = np.sqrt(squares)
        growth = self.top_radius - self.bottom_radius
        is_cylinder = abs(growth) < 1e-9
        heights = uv[:, 1] if is_cylinder else (radii - self.bottom_radius) / growth
        length = self.top_y - self.bottom_y
        cosines, sines = np.cos(angles), np.sin(angles)
        normals = np.stack([length * cosines, np.full_like(cosines, -growth), length * sines], 1)
        normals /= np.hypot(length, growth)
        mean_radius = 0.5 * (self.bottom_radius + self.top_radius)
        return SurfacePoints(
            positions=np.stack(
                [radii * cosines, self.bottom_y + length * heights, radii * sines], axis=1
            ),
            normals=-normals if self.faces_inward else normals,
            surface_xy=np.stack([mean_radius * angles, length * heights], axis=1),
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Disk:
    """A flat disk across +y."""

    radius: float
    y: float
    faces_down: bool = False

    @property
    def area(self) -> float:
        """Area [scene unit squared]."""
        return float(np.pi * self.radius**2)

    def at(self, uv: np.ndarray) -> SurfacePoints:
        """See `Shape.at`."""
        radii, angles = self.radius * np.sqrt(uv[:, 0]), 2 * np.pi * uv[:, 1]
        flat = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
        normal = [0.0, -1.0 if self.faces_down else 1.0, 0.0]
        return SurfacePoints(
            positions=np.stack([flat[:, 0], np.full_like(radii, self.y), flat[:, 1]], axis=1),
            normals=np.tile(normal, (len(uv), 1)),
            surface_xy=flat,
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Ball:
    """A sphere."""

    center: np.ndarray
    radius: float

    @property
    def area(self) -> float:
        """Area [scene unit squared]."""
        return float(4 * np.pi * self.radius**2)

    def at(self, uv: np.ndarray) -> SurfacePoints:
        """See `Shape.at`."""
        # Archimedes: equal heights of a sphere have equal areas.
        heights, angles = 2 * uv[:, 0] - 1, 2 * np.pi * uv[:, 1]
        across = np.sqrt(1 - heights**2)
        normals = np.stack([across * np.cos(angles), heights, across * np.sin(angles)], axis=1)
        return SurfacePoints(
            positions=self.center + self.radius * normals,
            normals=normals,
            surface_xy=self.radius * np.stack([angles, heights], axis=1),
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Placed:
    """A shape moved to another place."""

    shape: Shape
    placement: np.ndarray
    """From the shape's to the part's frame: a rotation and a translation, shape (4, 4)."""

    @property
    def area(self) -> float:
        """Area [scene unit squared]."""
        return self.shape.area

    def at(self, uv: np.ndarray) -> SurfacePoints:
        """See `Shape.at`."""
        points = self.shape.at(uv)
        rotation = self.placement[:3, :3]
        return SurfacePoints(
            positions=points.positions @ rotation.T + self.placement[:3, 3],
            normals=points.normals @ rotation.T,
            surface_xy=points.surface_xy,
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Patch:
    """A painted piece of surface of one rigid part."""

    shape: Shape
    pattern: Pattern
    detail: float = 1.0
    """Gaussians per area, relative to the other patches."""
    glow: float = 0.0
    """Share of the color that no shadow touches, 0..1."""
