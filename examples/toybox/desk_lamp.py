"""The example object: a desk lamp of five rigid parts, and how it moves."""

import numpy as np

from toybox.patterns import (
    checker,
    color_from_hex,
    dots,
    letters,
    plain,
    sectors,
    stripes,
)
from toybox.surfaces import Ball, Disk, Patch, Pattern, Placed, Rectangle, Tube

PART_NAMES = ("foot", "turret", "lower_arm", "upper_arm", "head")

_NAVY = color_from_hex("#1d3557")
_CREAM = color_from_hex("#fdf3df")
_CORAL = color_from_hex("#ef5b45")
_AMBER = color_from_hex("#f8b62d")
_TEAL = color_from_hex("#1fa08d")
_SKY = color_from_hex("#7cc6e8")
_PLUM = color_from_hex("#7d3c78")
_GLOW = color_from_hex("#fff1a8")
_STEEL = color_from_hex("#5b6770")

_SHOULDER_Y = 0.30
_ELBOW_Y = 0.62
"""Above the shoulder."""
_WRIST_Y = 0.46
"""Above the elbow."""


def patches_by_part() -> tuple[tuple[Patch, ...], ...]:
    """Return the painted surfaces of each part, in the part's frame: its joint at the origin."""
    return (_foot(), _turret(), _lower_arm(), _upper_arm(), _head())


def world_from_part(progress: float) -> np.ndarray:
    """Place the parts.

    Args:
        progress: 0 at rest, 1 at the end of the motion.

    Returns:
        Rigid transforms, shape (5, 4, 4).
    """
    turret = _turn("y", np.radians(38.0 * _ease(progress, 0.0, 1.0)))
    lower_arm = turret @ _hinge(_SHOULDER_Y, 30.0 - 48.0 * _ease(progress, 0.0, 0.85))
    upper_arm = lower_arm @ _hinge(_ELBOW_Y, -96.0 + 52.0 * _ease(progress, 0.1, 1.0))
    head = upper_arm @ _hinge(_WRIST_Y, -44.0 - 20.0 * _ease(progress, 0.3, 1.0))
    return np.stack([np.eye(4), turret, lower_arm, upper_arm, head])


def _foot() -> tuple[Patch, ...]:
    rim = checker(_NAVY, _CREAM, width=2 * np.pi * 0.36 / 24, height=0.04)
    top = sectors(_TEAL, _SKY, count=12, hub=_NAVY, hub_radius=0.23)
    return (
        _side(0.36, 0.0, 0.08, rim),
        Patch(shape=Disk(radius=0.36, y=0.08), pattern=top),
        Patch(shape=Disk(radius=0.34, y=0.0, faces_down=True), pattern=plain(_NAVY), detail=0.2),
    )


def _turret() -> tuple[Patch, ...]:
    side = stripes(_AMBER, _CORAL, width=2 * np.pi * 0.17 / 12, angle_rad=0.0)
    cone = Tube(bottom_radius=0.20, top_radius=0.13, bottom_y=0.08, top_y=_SHOULDER_Y - 0.05)
    return (
        Patch(shape=cone, pattern=side),
        Patch(shape=Disk(radius=0.13, y=_SHOULDER_Y - 0.05), pattern=plain(_STEEL), detail=0.6),
    )


def _lower_arm() -> tuple[Patch, ...]:
    name = letters("SPLAT", _NAVY, _CREAM, width=0.105, height=0.074)
    bands = stripes(_CORAL, _CREAM, width=0.05, angle_rad=np.radians(45.0))
    return (
        *_beam(0.0, _ELBOW_Y, 0.155, broad=name, narrow=bands),
        *_pin(0.11, 0.22, dots(_NAVY, (_AMBER, _SKY), spacing=0.055, radius=0.02)),
    )


def _upper_arm() -> tuple[Patch, ...]:
    spots = dots(_AMBER, (_PLUM, _CREAM, _TEAL), spacing=0.065, radius=0.025)
    squares = checker(_TEAL, _CREAM, width=0.055, height=0.055)
    return (
        *_beam(0.0, _WRIST_Y, 0.13, broad=spots, narrow=squares),
        *_pin(0.10, 0.20, sectors(_CORAL, _CREAM, count=8, hub=_NAVY, hub_radius=0.03)),
    )


def _head() -> tuple[Patch, ...]:
    shade_stripes = stripes(_CORAL, _CREAM, width=2 * np.pi * 0.15 / 10, angle_rad=0.0)
    outside = Tube(bottom_radius=0.08, top_radius=0.22, bottom_y=0.06, top_y=0.28)
    inside = Tube(
        bottom_radius=0.062, top_radius=0.202, bottom_y=0.06, top_y=0.28, faces_inward=True
    )
    neck = stripes(_NAVY, _SKY, width=0.03, angle_rad=np.radians(90.0))
    return (
        _side(0.08, -0.05, 0.06, neck),
        Patch(shape=Disk(radius=0.08, y=-0.05, faces_down=True), pattern=plain(_NAVY), detail=0.6),
        Patch(shape=outside, pattern=shade_stripes),
        Patch(shape=inside, pattern=plain(_GLOW), detail=0.5, glow=0.6),
        Patch(
            shape=Ball(center=np.array([0.0, 0.17, 0.0]), radius=0.075),
            pattern=plain(_GLOW),
            detail=0.6,
            glow=1.0,
        ),
    )


def _side(radius: float, bottom_y: float, top_y: float, pattern: Pattern) -> Patch:
    tube = Tube(bottom_radius=radius, top_radius=radius, bottom_y=bottom_y, top_y=top_y)
    return Patch(shape=tube, pattern=pattern)


def _beam(
    bottom_y: float, top_y: float, thickness: float, *, broad: Pattern, narrow: Pattern
) -> tuple[Patch, ...]:
    """Four faces of a square beam along +y: `broad` paint in front and behind."""
    half, middle = thickness / 2, (bottom_y + top_y) / 2
    up = np.array([0.0, top_y - bottom_y, 0.0])
    faces = []
    for quarter in range(4):
        turn = _turn("y", quarter * np.pi / 2)[:3, :3]
        face = Rectangle(
            center=turn @ [0.0, middle, half], right=turn @ [thickness, 0.0, 0.0], up=up
        )
        is_broad = quarter % 2 == 0
        faces.append(
            Patch(
                shape=face, pattern=broad if is_broad else narrow, detail=2.0 if is_broad else 1.2
            )
        )
    return tuple(faces)


def _pin(radius: float, length: float, face: Pattern) -> tuple[Patch, ...]:
    """The drum of a hinge: a closed cylinder about z."""
    along_z = _turn("x", np.pi / 2)
    tube = Tube(bottom_radius=radius, top_radius=radius, bottom_y=-length / 2, top_y=length / 2)
    caps = (Disk(radius=radius, y=length / 2), Disk(radius=radius, y=-length / 2, faces_down=True))
    return (
        Patch(shape=Placed(shape=tube, placement=along_z), pattern=plain(_STEEL), detail=0.6),
        *(Patch(shape=Placed(shape=cap, placement=along_z), pattern=face) for cap in caps),
    )


def _hinge(height: float, angle_deg: float) -> np.ndarray:
    """Turn about z at a height on the parent's y axis."""
    transform = _turn("z", np.radians(angle_deg))
    transform[1, 3] = height
    return transform


def _turn(axis: str, angle_rad: float) -> np.ndarray:
    """Return the right-handed turn about an axis, shape (4, 4)."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    transform = np.eye(4)
    transform[[first, second], [first, second]] = cosine
    transform[first, second], transform[second, first] = -sine, sine
    return transform


def _ease(progress: float, start: float, end: float) -> float:
    """Rise from 0 at `start` to 1 at `end` without a jerk."""
    share = float(np.clip((progress - start) / (end - start), 0.0, 1.0))
    return share * share * (3.0 - 2.0 * share)
