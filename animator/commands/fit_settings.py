"""The options of the command line in the words of the stages."""

import dataclasses
from pathlib import Path

from animator.config import AnimateOptions
from animator.deform.image_solver import ImageSolverConfig
from animator.deform.pace import PaceConfig
from animator.pipeline import FitConfig
from animator.rig.bake import ClipLabels
from animator.scene import FrameOptions, Scene, SceneOverrides
from animator.sequence.driver import DriverConfig
from animator.sequence.loosening import LooseningConfig
from animator.sequence.rigid_stage import RigidStageConfig


def scene_overrides(options: AnimateOptions) -> SceneOverrides:
    """Return the inputs that the user named."""
    return SceneOverrides(
        gaussians=options.gaussians,
        cameras=options.cameras,
        frame_camera=options.frame_camera,
        masks=options.masks,
        depth=options.depth,
    )


def frame_options(options: AnimateOptions) -> FrameOptions:
    """Return which frames to read, and how."""
    return FrameOptions(
        numbers=options.frames,
        every=options.every,
        fps=options.fps,
        max_size_px=options.max_size,
    )


def fit_config(options: AnimateOptions) -> FitConfig:
    """Return every choice of the fit."""
    return FitConfig(
        anchors=options.anchors,
        inbetween=options.inbetween,
        moving_camera=options.moving_camera,
        matcher=options.matcher,
        roma_weights=tuple(str(path) for path in options.roma_weights),
        device=options.device,
        seed=options.seed,
        driver=_driver_config(options),
        loosening=LooseningConfig(pace=_paced(LooseningConfig().pace, options)),
    )


def clip_labels(options: AnimateOptions, scene: Scene, first_out: Path) -> ClipLabels:
    """Return what the clip says about itself."""
    return ClipLabels(
        name=options.name or first_out.stem,
        fps=scene.frames.fps,
        up_axis=options.up_axis,
        meters_per_unit=options.meters_per_unit,
    )


def _driver_config(options: AnimateOptions) -> DriverConfig:
    """Apply the ablations of the paper (Table 3) and the number of steps to the defaults."""
    return DriverConfig(
        use_matches=options.deform,
        rigid=RigidStageConfig(
            use_growing=options.region_growing, use_refinement=options.refinement
        ),
        image_solver=_image_solver_config(options),
    )


def _image_solver_config(options: AnimateOptions) -> ImageSolverConfig:
    defaults = ImageSolverConfig()
    weights = defaults.weights
    if not options.deform:
        weights = dataclasses.replace(weights, deform=0.0)
    if not options.group:
        weights = dataclasses.replace(weights, group=0.0)
    return dataclasses.replace(defaults, weights=weights, pace=_paced(defaults.pace, options))


def _paced(pace: PaceConfig, options: AnimateOptions) -> PaceConfig:
    return dataclasses.replace(pace, most_steps=options.iterations or pace.most_steps)
