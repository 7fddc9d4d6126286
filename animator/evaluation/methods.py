"""The methods that are compared: ours, with parts switched off, and baselines."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Literal

from animator.deform.coarse_motion import CoarseConfig
from animator.deform.image_solver import ImageSolverConfig, LossWeights
from animator.deform.losses import SQUARES
from animator.errors import InputError
from animator.pipeline import FitConfig
from animator.sequence.light_stage import LightStageConfig
from animator.sequence.limb_search import LimbSearchConfig
from animator.sequence.loosening import LooseningConfig
from animator.sequence.rigid_body import RigidBodyConfig
from animator.sequence.second_look import SecondLookConfig
from animator.sequence.smooth_motion import SmoothMotionConfig
from animator.sequence.smoothing import SmoothingConfig
from animator.sequence.steadying import SteadyingConfig


@dataclasses.dataclass(frozen=True, kw_only=True)
class Method:
    """One way to animate a scene."""

    summary: str
    """What it is, for the table's legend."""
    kind: Literal["rig", "still", "free"] = "rig"
    """Our pipeline; nothing moves; every Gaussian is free."""
    switches: Mapping[str, bool] = dataclasses.field(default_factory=dict)
    """Options of `animate` that differ from the run's."""
    adjust: Callable[[FitConfig], FitConfig] = lambda config: config
    """What no option of `animate` says."""


def _rgb_and_arap(config: FitConfig) -> FitConfig:
    """Leave anchors, RGB and plain ARAP under plain Adam; everything else goes, known here or not."""
    solver = config.driver.image_solver
    off = {field.name: 0.0 for field in dataclasses.fields(LossWeights)}
    kept = {"rgb": solver.weights.rgb, "arap": solver.weights.arap}
    image_solver = ImageSolverConfig(
        # Without the preconditioner it takes up to three times the steps to get as far.
        pace=dataclasses.replace(solver.pace, most_steps=3 * solver.pace.most_steps),
        smoothing=0.0,
        coarse=CoarseConfig(nodes=()),
        arap_norm=SQUARES,
        weights=LossWeights(**{**off, **kept}),
    )
    return dataclasses.replace(
        config,
        driver=dataclasses.replace(
            config.driver,
            image_solver=image_solver,
            continue_motion=False,
            light=LightStageConfig(spread=0.0),
            limb_search=LimbSearchConfig(most_swings=0),
        ),
        second_look=SecondLookConfig(every=0),
        smooth_motion=SmoothMotionConfig(residual=0.0),
        loosening=LooseningConfig(every=0),
        steadying=SteadyingConfig(
            smoothing=SmoothingConfig(strength=0.0), rigid_body=RigidBodyConfig(residual=0.0)
        ),
    )


_NO_MATCHES = {"deform": False, "group": False, "region_growing": False, "refinement": False}

METHODS: dict[str, Method] = {
    "static": Method(summary="the model left at rest: the floor", kind="still"),
    "rgb-only": Method(
        summary="every Gaussian free, Adam on RGB alone: the paper's 3DGS", kind="free"
    ),
    "rgb-arap": Method(
        summary="anchors, RGB and ARAP under plain Adam, no matches: like SC-GS",
        switches=_NO_MATCHES,
        adjust=_rgb_and_arap,
    ),
    "no-match": Method(
        summary="ours without matches, and so without what starts from them",
        switches={"deform": False},
    ),
    "no-deform-group": Method(
        summary="ours without deformation and group losses", switches=_NO_MATCHES
    ),
    "no-group": Method(summary="ours without the group loss", switches={"group": False}),
    "no-region-growing": Method(
        summary="ours without groups grown from matches", switches={"region_growing": False}
    ),
    "no-refinement": Method(
        summary="ours without refinement of the groups", switches={"refinement": False}
    ),
    "full": Method(summary="ours"),
}
"""By name, in the order of the tables."""

METHOD_SETS: dict[str, tuple[str, ...]] = {
    "baselines": ("static", "rgb-only", "rgb-arap", "no-match", "full"),
    "ablation": (
        "no-deform-group",
        "no-group",
        "no-region-growing",
        "no-refinement",
        "full",
    ),
    "all": tuple(METHODS),
}
"""Names for several methods: the paper's tables."""


def chosen_methods(text: str) -> tuple[str, ...]:
    """Return the methods of a comma-separated list of methods and sets, in the tables' order.

    Raises:
        InputError: If a name is not known.
    """
    chosen: set[str] = set()
    for name in filter(None, (part.strip() for part in text.split(","))):
        if name not in METHODS and name not in METHOD_SETS:
            raise InputError(
                f"--methods: expected names among {', '.join(METHODS)}, or the sets "
                f"{', '.join(METHOD_SETS)}; found {name!r}."
            )
        chosen |= set(METHOD_SETS.get(name, (name,)))
    if not chosen:
        raise InputError(f"--methods: expected at least one of {', '.join(METHODS)}, found none.")
    return tuple(name for name in METHODS if name in chosen)
