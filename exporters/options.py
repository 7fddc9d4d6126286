"""What goes into the written files, and how: one set of choices for every format."""

import dataclasses
from typing import Literal

LEAST_FACES = 100
"""Fewer triangles do not hold a shape."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """Choices of the user; the defaults suit most tools. `exporters.profiles` names sets of them.

    A writer ignores what its format has no place for.
    """

    mesh: Literal["quads", "surface", "both", "none"] = "quads"
    """What carries the skin: one quad a Gaussian, a closed surface, both, or no mesh at all."""
    faces: int = 20_000
    """Most triangles of the surface, at least `LEAST_FACES`."""
    splats: Literal["none", "rest", "parts"] = "rest"
    """Splats in a glTF file: none, at rest in a second scene, or one moving primitive a part."""
    usd_splats: Literal["none", "sibling", "payload"] = "none"
    """Time-sampled splats in a USD rig: none, beside the mesh, or in a file of their own."""
    rotate_sh: bool = False
    """Turn the view-dependent colors with the Gaussians, frame by frame, in the caches."""
    tolerance: float = 0.0
    """Keys may go while no Gaussian moves by more than this share of the diagonal; 0 keeps all."""
    tolerance_degrees: float = 1.0
    """... and no joint turns by more than this in world space; counts only with a `tolerance`."""
    precision: Literal["float", "half"] = "float"
    """Of rotations and spherical harmonics in a USD cache; half rotations are 0.06 degrees off."""
    texture: bool = False
    """Give a closed surface its colors by a texture too, in USD; for tools without vertex colors."""
    camera: bool = True
    """Write the solved camera, if the clip has one."""
    alpha_cutoff: float = 0.2
    """Carrier quads fainter than this are not drawn by tools that do not blend them, 0..1."""
    fps: float | None = None
    """Frames per second of USD time codes and caches; None for the clip's own. Times stay."""
    up_axis: Literal["Y", "Z"] | None = None
    """Turn the clip so that this axis is up; None leaves it (glTF is always Y-up)."""
    meters_per_unit: float | None = None
    """Scale the clip to this unit; None leaves it (glTF is always in meters)."""
    joint_limit: int | None = None
    """Most joints the target takes: of a rig with more, those that matter least are merged."""
