"""Sets of choices for the tools that assets go to. A profile is a start: every flag wins over it.

How each is known: `ran` here against that tool, `read` in its documentation or source, or a `rule`
that its maker states and a test holds our files to. Common to all, since nothing gains by less: four
influences a vertex, weights that sum to one, one root joint, time codes from 0.
"""

import dataclasses
from typing import Literal

from exporters.options import ExportOptions


@dataclasses.dataclass(frozen=True, kw_only=True)
class Profile:
    """What one tool, or one kind of tool, likes best."""

    purpose: str
    """What it is for, in a few words."""
    options: ExportOptions
    """The choices; those not named are the defaults of `ExportOptions`."""
    suffix: str
    """The format to prefer."""
    known: Literal["ran", "read", "rule"]
    """How the choices are known to be right."""
    because: str
    """Why these choices, in a sentence or two."""


EIGHT_BIT_JOINTS = 254
"""Scene Viewer takes 254; Unreal's bone indices and Spark's are 8 bits wide."""

PROFILES: dict[str, Profile] = {
    "generic": Profile(
        purpose="any tool",
        options=ExportOptions(),
        suffix=".usdc or .glb",
        known="ran",
        because="UsdSkel, Blender and three.js play it; both formats name their axes and rate.",
    ),
    "blender": Profile(
        purpose="Blender 5",
        options=ExportOptions(fps=24.0, up_axis="Z", meters_per_unit=1.0, splats="none"),
        suffix=".usdc or .glb",
        known="ran",
        because=(
            "A new scene runs at 24 and stays there on import, one time code a frame; Z-up meters "
            "come in without a turned or scaled object; the splats of a glTF file would come in as "
            "loose points, in a collection that is switched off."
        ),
    ),
    "unreal": Profile(
        purpose="Unreal Engine 5",
        options=ExportOptions(
            mesh="surface",
            splats="none",
            up_axis="Z",
            meters_per_unit=0.01,
            joint_limit=EIGHT_BIT_JOINTS,
        ),
        suffix=".usdc",
        known="rule",
        because=(
            "Z-up centimeters are the engine's own (FUsdStageOptions), bone indices have 8 bits "
            "unless the project says otherwise, and a closed mesh needs no masked material."
        ),
    ),
    "houdini": Profile(
        purpose="Houdini, Solaris",
        options=ExportOptions(up_axis="Y", meters_per_unit=1.0, usd_splats="payload"),
        suffix=".usdc",
        known="read",
        because=(
            "Y-up meters are its own; its USD knows the splat schema: the variant `splats` shows "
            "them in place of the mesh, and a payload can stay unloaded."
        ),
    ),
    "omniverse": Profile(
        purpose="Omniverse, Isaac Sim",
        options=ExportOptions(up_axis="Z", meters_per_unit=1.0, usd_splats="payload"),
        suffix=".usdc",
        known="rule",
        because=(
            "SimReady assets are Z-up, in meters; RTX draws the splat schema: the variant `splats` "
            "shows them in place of the mesh."
        ),
    ),
    "web": Profile(
        purpose="three.js, model-viewer, Scene Viewer",
        options=ExportOptions(
            mesh="surface",
            faces=20_000,
            splats="none",
            tolerance=5e-4,
            camera=False,
            joint_limit=EIGHT_BIT_JOINTS,
        ),
        suffix=".glb",
        known="ran",
        because=(
            "Small to load: a surface below Scene Viewer's 30,000 vertices, keys to half a "
            "thousandth of the diagonal, and its hard limit of 254 joints; viewers bring their own "
            "camera."
        ),
    ),
    "arkit": Profile(
        purpose="Quick Look, RealityKit",
        options=ExportOptions(
            mesh="surface",
            faces=20_000,
            splats="none",
            texture=True,
            tolerance=5e-4,
            camera=False,
            up_axis="Y",
            meters_per_unit=1.0,
            joint_limit=EIGHT_BIT_JOINTS,
        ),
        suffix=".usdz",
        known="rule",
        because=(
            "One skinned mesh in one package of UsdUtils for ARKit; Quick Look knows no vertex "
            "colors, hence a texture, and no cameras; Apple advises below 100,000 polygons."
        ),
    ),
}
"""Every profile by name."""
