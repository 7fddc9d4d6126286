"""Gaussians as a ParticleField3DGaussianSplat, moved by samples at every whole time code."""

import numpy as np
from pxr import Gf, Usd, UsdVol, Vt

from exporters import bounds, keyframes
from exporters.baking import BakedFrame, Progress, bake_frames
from exporters.clip import Clip, Splats
from exporters.options import ExportOptions
from exporters.usd import values
from exporters.usd.samples import SampledArray, writing_samples

SPLATS_NAME = "Splats"

COLOR_SPACE = "srgb_rec709_display"
"""What splats are trained in: sRGB as displayed, which is also its name in KHR_gaussian_splatting."""


def write_splats(
    stage: Usd.Stage,
    clip: Clip,
    path: str,
    options: ExportOptions,
    progress: Progress | None = None,
) -> np.ndarray:
    """Write the Gaussians, frame by frame: memory does not grow with the length of the clip.

    Sampled are positions, orientations and the 3-sigma extent, and with `rotate_sh` the spherical
    harmonics; the rest is written once.

    Args:
        stage: Receives the prim. What is in it is saved, and prims found before may expire.
        clip: A valid clip.
        path: Path of the prim.
        options: `rotate_sh` and `precision` count here.
        progress: Called with the frames done and their total.

    Returns:
        The box of the whole motion [scene unit], rows min and max, float32, shape (2, 3).
    """
    rotate_sh = options.rotate_sh and clip.splats.sh_degree > 0
    is_half = options.precision == "half"
    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, path)
    _state_color_space(field.GetPrim())
    _define_constants(field, clip.splats)
    orientations = field.CreateOrientationshAttr() if is_half else field.CreateOrientationsAttr()
    harmonics = _harmonics_attribute(field, is_half=is_half)
    vector_type = Vt.Vec3hArray if is_half else Vt.Vec3fArray
    arrays = [
        SampledArray(attribute=field.CreatePositionsAttr(), array_type=Vt.Vec3fArray),
        SampledArray(
            attribute=orientations, array_type=Vt.QuathArray if is_half else Vt.QuatfArray
        ),
        SampledArray(attribute=field.CreateExtentAttr(), array_type=Vt.Vec3fArray),
    ]
    if rotate_sh:
        arrays.append(SampledArray(attribute=harmonics, array_type=vector_type))
    else:
        rows = _harmonics_rows(clip.splats.sh_coeffs, is_half=is_half)
        harmonics.Set(vector_type.FromNumpy(rows))

    ellipsoids = bounds.Ellipsoids(clip.splats.scales)
    extents = []
    codes = range(keyframes.frame_count(clip))
    with writing_samples(stage, arrays, codes) as write:
        for frame in bake_frames(clip, progress, rotate_sh=rotate_sh):
            extents.append(ellipsoids.extent(frame.posed))
            write(*_sampled_rows(frame, extents[-1], is_half=is_half))
    return bounds.point_extent(np.concatenate(extents))


def _define_constants(field: UsdVol.ParticleField3DGaussianSplat, splats: Splats) -> None:
    """Author what never changes.

    Every attribute has exactly one value a Gaussian (K for the harmonics): readers that find
    another count ignore the attribute, or the prim. Scales are linear and opacities 0..1.
    """
    field.CreateScalesAttr(values.vectors(splats.scales))
    field.CreateOpacitiesAttr(values.floats(splats.opacities))
    field.CreateProjectionModeHintAttr(UsdVol.Tokens.perspective)
    field.CreateSortingModeHintAttr(UsdVol.Tokens.zDepth)  # as INRIA's renderer, that trains them
    field.CreateRadianceSphericalHarmonicsDegreeAttr(splats.sh_degree)


def _state_color_space(prim: Usd.Prim) -> None:
    """Say that the colors are sRGB as displayed; without a word USD takes them for linear.

    USD knows by name only spaces that refer to a scene. Those who write splats call theirs
    `srgb_rec709_display` nevertheless (3DGRUT, fVDB, and glTF's extension); so we do, and define it
    beside, with which USD resolves it: Rec. 709 primaries, D65, and the curve of sRGB.
    """
    definition = Usd.ColorSpaceDefinitionAPI.Apply(prim, COLOR_SPACE)
    definition.CreateNameAttr(COLOR_SPACE)
    definition.CreateColorSpaceAttrsWithChroma(
        Gf.Vec2f(0.64, 0.33),
        Gf.Vec2f(0.30, 0.60),
        Gf.Vec2f(0.15, 0.06),
        Gf.Vec2f(0.3127, 0.3290),
        2.4,
        0.055,
    )
    Usd.ColorSpaceAPI.Apply(prim).CreateColorSpaceNameAttr(COLOR_SPACE)


def _harmonics_attribute(
    field: UsdVol.ParticleField3DGaussianSplat, *, is_half: bool
) -> Usd.Attribute:
    if is_half:
        return field.CreateRadianceSphericalHarmonicsCoefficientshAttr()
    return field.CreateRadianceSphericalHarmonicsCoefficientsAttr()


def _harmonics_rows(sh_coeffs: np.ndarray, *, is_half: bool) -> np.ndarray:
    return sh_coeffs.reshape(-1, 3).astype(np.float16 if is_half else np.float32, copy=False)


def _sampled_rows(frame: BakedFrame, extent: np.ndarray, *, is_half: bool) -> list[np.ndarray]:
    """Return what changes with the frame, in the order of the sampled arrays."""
    rows = [
        frame.posed.positions,
        values.xyzw(frame.posed.quats_wxyz, np.float16 if is_half else np.float32),
        extent.astype(np.float32),
    ]
    if frame.sh_coeffs is not None:
        rows.append(_harmonics_rows(frame.sh_coeffs, is_half=is_half))
    return rows
