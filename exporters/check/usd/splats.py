"""Rules for ParticleField3DGaussianSplat (UsdVol), one sample in memory at a time.

A reader ignores an array that is too short; Blender 5.3 ignores the whole prim if one array is
missing or of another length.
"""

import dataclasses
from collections.abc import Iterator

from pxr import Usd, UsdVol

from exporters.check import gaussians
from exporters.check.problem import Problem
from exporters.check.usd.values import place, rows, sample_times

MAX_SH_DEGREE = 4
"""Blender 5.3 reads up to degree 4; the schema names no limit."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SplatAttributes:
    """The arrays of one prim, of the float or the half kind."""

    positions: Usd.Attribute
    orientations: Usd.Attribute
    scales: Usd.Attribute
    opacities: Usd.Attribute
    harmonics: Usd.Attribute

    @classmethod
    def of(cls, field: UsdVol.ParticleField3DGaussianSplat) -> "SplatAttributes":
        """Choose the kind that counts: float where both are authored (UsdVol)."""
        radiance = "RadianceSphericalHarmonicsCoefficients"
        return cls(
            positions=_chosen(field.GetPositionsAttr(), field.GetPositionshAttr()),
            orientations=_chosen(field.GetOrientationsAttr(), field.GetOrientationshAttr()),
            scales=_chosen(field.GetScalesAttr(), field.GetScaleshAttr()),
            opacities=_chosen(field.GetOpacitiesAttr(), field.GetOpacitieshAttr()),
            harmonics=_chosen(
                getattr(field, f"Get{radiance}Attr")(), getattr(field, f"Get{radiance}hAttr")()
            ),
        )

    @property
    def all(self) -> tuple[Usd.Attribute, ...]:
        """Every array."""
        return tuple(getattr(self, each.name) for each in dataclasses.fields(self))


def splat_problems(stage: Usd.Stage) -> Iterator[Problem]:
    """Hold every prim of Gaussians to the rules."""
    for prim in stage.Traverse():
        if prim.IsA(UsdVol.ParticleField3DGaussianSplat):
            yield from field_problems(UsdVol.ParticleField3DGaussianSplat(prim))


def field_problems(field: UsdVol.ParticleField3DGaussianSplat) -> Iterator[Problem]:
    """Every array has a value a Gaussian, activated, in every sample; the extent holds them all.

    What does not change is looked at once; what was wrong once is not reported again.
    """
    attributes = SplatAttributes.of(field)
    degree_attribute = field.GetRadianceSphericalHarmonicsDegreeAttr()
    degree = degree_attribute.Get()
    if degree is None or not 0 <= degree <= MAX_SH_DEGREE:
        expected = f"a degree of 0..{MAX_SH_DEGREE}"
        yield Problem(place=place(degree_attribute), expected=expected, found=str(degree))
        degree = None
    sh_count = None if degree is None else (degree + 1) ** 2
    varying = [each for each in attributes.all if each.GetNumTimeSamples()]
    extent = field.GetExtentAttr()
    first_count: int | None = None
    settled: set[str] = set()  # nothing new to say about these
    for time in sample_times([*varying, extent]):
        positions = rows(attributes.positions, time)
        count = len(positions)
        if first_count is None:
            first_count = count
        if (count == 0 or count != first_count) and "positions" not in settled:
            settled.add("positions")
            expected = f"{first_count or 'some'} positions, the same number in all samples"
            found = str(count)
            yield Problem(place=place(attributes.positions, time), expected=expected, found=found)
        if count == 0:
            return
        for attribute in attributes.all[1:]:
            name = attribute.GetName()
            if name in settled:
                continue
            per_gaussian = sh_count if attribute == attributes.harmonics else 1
            problems = [*array_problems(attribute, time, count, per_gaussian)]
            yield from problems
            if problems or attribute not in varying:
                settled.add(name)
        if "extent" not in settled:
            problems = [*_extent_problems(extent, attributes, time)]
            yield from problems
            if problems:
                settled.add("extent")


def array_problems(
    attribute: Usd.Attribute, time: Usd.TimeCode, count: int, per_gaussian: int | None
) -> Iterator[Problem]:
    """An array has exactly its number of values; scales are linear, opacities in 0..1.

    Args:
        attribute: One of the arrays.
        time: When.
        count: Number of Gaussians.
        per_gaussian: Values of each; None if that is not known.
    """
    where = place(attribute, time)
    values = rows(attribute, time)
    if per_gaussian is not None and len(values) != count * per_gaussian:
        expected = f"{count * per_gaussian} values, {per_gaussian} for each of {count} Gaussians"
        yield Problem(place=where, expected=expected, found=str(len(values)))
    elif attribute.GetName().startswith("scales"):
        yield from gaussians.linear_scales(where, values)
    elif attribute.GetName().startswith("opacities"):
        yield from gaussians.opacities(where, values)


def _extent_problems(
    extent_attribute: Usd.Attribute, attributes: SplatAttributes, time: Usd.TimeCode
) -> Iterator[Problem]:
    """The extent is authored, since no plugin computes it, and holds the 3-sigma ellipsoids."""
    where = place(extent_attribute, time)
    extent = rows(extent_attribute, time)
    if len(extent) != 2:
        found = f"{len(extent)} corners"
        yield Problem(place=where, expected="an extent of two corners", found=found)
        return
    positions, orientations, scales = (
        rows(each, time)
        for each in (attributes.positions, attributes.orientations, attributes.scales)
    )
    if len(positions) == len(orientations) == len(scales):
        yield from gaussians.ellipsoids_in_extent(where, extent, positions, orientations, scales)


def _chosen(full: Usd.Attribute, half: Usd.Attribute) -> Usd.Attribute:
    return half if half.HasAuthoredValue() and not full.HasAuthoredValue() else full
