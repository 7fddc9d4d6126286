"""Every layout that the exporters write, for rules that must stay silent on all of them."""

import typing

from exporters.options import ExportOptions

ENDINGS = (
    *(".usda", ".usdc", ".usdz", ".glb", ".gltf", ".splatimate.npz"),
    *("_gaussians", "_gaussians.usda", "_gaussians.usdc"),
)
"""One of each kind of file."""


def _choices(field: str) -> tuple[str, ...]:
    """Return what a field of the options may be, so that new choices join in."""
    return typing.get_args(typing.get_type_hints(ExportOptions)[field])


LAYOUTS: dict[str, tuple[str, ExportOptions]] = {
    **{
        f"mesh {mesh}{end}": (end, ExportOptions(mesh=mesh, faces=200))
        for mesh in _choices("mesh")
        for end in (".usdc", ".glb")
    },
    **{f"splats {splats}": (".glb", ExportOptions(splats=splats)) for splats in _choices("splats")},
    **{
        f"usd_splats {splats}{end}": (end, ExportOptions(usd_splats=splats))
        for splats in _choices("usd_splats")
        for end in (".usda", ".usdc", ".usdz")
    },
    **{
        f"rotated harmonics{end}": (end, ExportOptions(rotate_sh=True))
        for end in ("_gaussians", "_gaussians.usdc", "_gaussians.usda")
    },
    "half rotations": ("_gaussians.usdc", ExportOptions(precision="half")),
    "half rotations and harmonics": (
        "_gaussians.usdc",
        ExportOptions(precision="half", rotate_sh=True),
    ),
    "texture": (".usdc", ExportOptions(mesh="surface", faces=100, texture=True)),
    "fewer joints": (".usdc", ExportOptions(joint_limit=3)),
    **{
        f"fewer keys{end}": (end, ExportOptions(tolerance=1e-3, tolerance_degrees=1.0))
        for end in (".usdc", ".glb")
    },
    **{
        f"other axes{end}": (
            end,
            ExportOptions(up_axis="Z", meters_per_unit=0.01, fps=30.0, camera=False),
        )
        for end in (".usdc", ".glb", "_gaussians.usdc", "_gaussians")
    },
}
"""By name: the end of a path, and the options to write it with."""
