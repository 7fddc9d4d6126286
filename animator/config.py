"""The options of `animate`: the one definition that flags, TOML files and help texts come from."""

# ruff: noqa: RUF009 - `_option` is `dataclasses.field` with the option's description.

import dataclasses
from pathlib import Path
from typing import Any, Literal, get_args, get_type_hints

from animator.commands import value_kind
from animator.commands.value_kind import ValueKind
from exporters.options import LEAST_FACES, ExportOptions
from exporters.profiles import PROFILES

INPUTS = "inputs (found beside FRAMES unless given)"
FRAMES = "which frames"
OUTPUTS = "outputs"
WRITTEN = "what is in them (a flag wins over the profile)"
METHOD = "method"
ABLATION = "ablation (switch one part of the method off)"
RUN = "this run"


@dataclasses.dataclass(frozen=True, kw_only=True)
class OptionInfo:
    """What the command line and a TOML file need to know about one option."""

    kind: ValueKind
    """The values it takes; of one item if it is repeatable."""
    group: str
    """Heading in the help text."""
    help: str
    """One line of help."""
    short: str | None = None
    """One-letter flag."""
    is_repeatable: bool = False
    """Whether the flag may be given several times; a list in TOML."""


def _option(default: Any, kind: ValueKind, group: str, help_text: str, **more: Any) -> Any:
    info = OptionInfo(kind=kind, group=group, help=help_text, **more)
    return dataclasses.field(default=default, metadata={"info": info})


def _export_option(name: str, help_text: str, kind: ValueKind | None = None) -> Any:
    """Define an option that is a field of `ExportOptions`: None unless given, so that a profile counts.

    Args:
        name: The field.
        help_text: One line of help.
        kind: The values it takes; None for one of the field's literals.
    """
    kind = kind or value_kind.choice(*get_args(get_type_hints(ExportOptions)[name]))
    default = getattr(ExportOptions(), name)
    shown = "" if kind.metavar is None else f" (default: {default})"
    return _option(None, kind, WRITTEN, help_text + shown)


@dataclasses.dataclass(frozen=True, kw_only=True)
class AnimateOptions:
    """Every option of `animate`; the defaults of this class are the defaults of the tool."""

    gaussians: Path | None = _option(
        None, value_kind.path("PLY"), INPUTS, "the splat at rest, INRIA layout"
    )
    cameras: Path | None = _option(
        None,
        value_kind.path(),
        INPUTS,
        "cameras of the capture: transforms*.json, cameras.json, COLMAP folder",
    )
    frame_camera: Path | None = _option(
        None,
        value_kind.path("PATH|auto"),
        INPUTS,
        "camera of the clip, or `auto`: find the best view and refine its pose",
    )
    moving_camera: bool = _option(
        False, value_kind.switch(), INPUTS, "estimate a camera for every frame"
    )
    masks: Path | None = _option(
        None, value_kind.path("FOLDER"), INPUTS, "masks of the frames, white on the object"
    )
    depth: Path | None = _option(
        None,
        value_kind.path("FOLDER"),
        INPUTS,
        "depth maps of the frames, one .npy or gray image each, from a depth camera or network",
    )

    frames: tuple[int, ...] | None = _option(
        None, value_kind.listed(value_kind.whole(0), ","), FRAMES, "only these frame numbers"
    )
    every: int | None = _option(None, value_kind.whole(1), FRAMES, "only every N-th frame")
    inbetween: int = _option(
        0, value_kind.whole(0, "K"), FRAMES, "add K smooth frames between two solved ones"
    )
    fps: float | None = _option(
        None,
        value_kind.positive("RATE"),
        FRAMES,
        "frames per second (default: the video's own, else 24)",
    )
    max_size: int | None = _option(
        None, value_kind.whole(16, "PX"), FRAMES, "shrink frames whose longer side is above this"
    )

    out: tuple[Path, ...] = _option(
        (),
        value_kind.path("FILE"),
        OUTPUTS,
        "asset to write: .usd .usda .usdc .usdz .glb .gltf; repeatable",
        short="-o",
        is_repeatable=True,
    )
    cache: str = _option(
        "both",
        value_kind.choice("ply", "usd", "both", "none"),
        OUTPUTS,
        "exact Gaussians of every frame: a PLY each, one time-sampled USD, or both",
    )
    name: str | None = _option(
        None, value_kind.text("NAME"), OUTPUTS, "name of the asset (default: the file's)"
    )
    up_axis: str = _option("Y", value_kind.choice("Y", "Z"), OUTPUTS, "up axis of the splat")
    meters_per_unit: float = _option(
        1.0, value_kind.positive("M"), OUTPUTS, "meters in one unit of the splat"
    )
    overwrite: bool = _option(
        False, value_kind.switch(), OUTPUTS, "replace outputs that already exist"
    )

    profile: str = _option(
        "generic",
        value_kind.choice(*PROFILES),
        WRITTEN,
        "what the tool you write for likes best; `splatimate profiles` lists the choices of each",
    )
    mesh: Literal["quads", "surface", "both", "none"] | None = _export_option(
        "mesh", "what carries the skin: a quad a Gaussian, a closed surface, both or none"
    )
    faces: int | None = _export_option(
        "faces", "most triangles of the surface", value_kind.whole(LEAST_FACES)
    )
    splats: Literal["none", "rest", "parts"] | None = _export_option(
        "splats", "splats in glTF: none, at rest in a second scene, or a moving set a rigid part"
    )
    usd_splats: Literal["none", "sibling", "payload"] | None = _export_option(
        "usd_splats", "moving splats in USD: none, beside the mesh, or in a file of their own"
    )
    rotate_sh: bool | None = _export_option(
        "rotate_sh",
        "turn view-dependent colors with the Gaussians in the caches, which grow by them a frame",
        value_kind.switch(),
    )
    precision: Literal["float", "half"] | None = _export_option(
        "precision", "numbers of rotations and view-dependent colors in USD caches"
    )
    tolerance: float | None = _export_option(
        "tolerance",
        "leave out keys while no Gaussian moves by more than this share of the diagonal",
        value_kind.share(),
    )
    tolerance_degrees: float | None = _export_option(
        "tolerance_degrees",
        "... and no joint turns by more than this; counts with a tolerance above 0",
        value_kind.not_negative("DEG"),
    )

    matcher: str = _option(
        "auto",
        value_kind.choice("auto", "flow", "xfeat", "roma"),
        METHOD,
        "finds where the pixels went",
    )
    roma_weights: tuple[Path, ...] = _option(
        (),
        value_kind.path("FILE"),
        METHOD,
        "weight file of RoMa or DINOv2; repeatable",
        is_repeatable=True,
    )
    anchors: int = _option(
        200,
        value_kind.whole(1),
        METHOD,
        "wanted anchors; a joint each, and a root; twice as many if motion is smooth",
    )
    iterations: int | None = _option(
        None, value_kind.whole(1), METHOD, "most optimizer steps a frame (fewer is faster)"
    )
    min_iou: float = _option(
        0.5, value_kind.share(), METHOD, "quality gate: a lower mean silhouette IoU exits with 4"
    )
    seed: int = _option(0, value_kind.whole(0), METHOD, "seed of every random choice")

    deform: bool = _option(True, value_kind.switch(), ABLATION, "no matches, no deformation loss")
    group: bool = _option(True, value_kind.switch(), ABLATION, "no rigid-group loss")
    region_growing: bool = _option(
        True, value_kind.switch(), ABLATION, "no groups grown from matches"
    )
    refinement: bool = _option(
        True, value_kind.switch(), ABLATION, "no refinement of the groups on the way"
    )

    device: Literal["auto", "cpu", "cuda"] = _option(
        "auto", value_kind.choice("auto", "cpu", "cuda"), RUN, "where to compute"
    )
    threads: int | None = _option(None, value_kind.whole(1), RUN, "most CPU threads")
    resume: bool = _option(
        False, value_kind.switch(), RUN, "continue an interrupted run of the same inputs"
    )
    dry_run: bool = _option(
        False, value_kind.switch(), RUN, "say what would run and be written, write nothing"
    )
    quiet: bool = _option(False, value_kind.switch(), RUN, "say errors only", short="-q")
    verbose: bool = _option(
        False, value_kind.switch(), RUN, "say everything, tracebacks too", short="-v"
    )


def option_infos() -> dict[str, OptionInfo]:
    """Return what is known of each option, by field name, in the order of the help text."""
    return {field.name: field.metadata["info"] for field in dataclasses.fields(AnimateOptions)}


def default_of(name: str) -> Any:
    """Return the default of one option."""
    return AnimateOptions.__dataclass_fields__[name].default
