"""Mistakes in the modules that change conventions, to prove that the golden files show them."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from exporters.clip import Clip


@dataclasses.dataclass(frozen=True, kw_only=True)
class ConversionMutant:
    """A mistake in the one module of a format that changes conventions."""

    patches: Callable[[pytest.MonkeyPatch], None]
    """Puts the mistake in place of the conversion."""
    form: str
    """The format that is wrong then."""
    shows_at: str
    """Part of the path of at least one difference."""
    case: str = "random"
    """The golden clip that shows it."""


def forget_gltf_quaternion_order(patch: pytest.MonkeyPatch) -> None:
    from exporters.gltf import order

    patch.setattr(order, "xyzw", lambda quats_wxyz: np.asarray(quats_wxyz, np.float32))


def forget_gltf_matrix_order(patch: pytest.MonkeyPatch) -> None:
    from exporters.gltf import order

    patch.setattr(
        order, "column_major", lambda matrices: matrices.astype(np.float32).reshape(-1, 16)
    )


def forget_gltf_axes_and_unit(patch: pytest.MonkeyPatch) -> None:
    from exporters.gltf import write

    patch.setattr(write, "adapt_to_gltf", lambda clip, options: clip)


def forget_usd_quaternion_order(patch: pytest.MonkeyPatch) -> None:
    from pxr import Vt

    from exporters.usd import values

    patch.setattr(
        values, "quats", lambda quats_wxyz: Vt.QuatfArray.FromNumpy(quats_wxyz.astype(np.float32))
    )


def forget_usd_matrix_order(patch: pytest.MonkeyPatch) -> None:
    from pxr import Vt

    from exporters.usd import values

    patch.setattr(
        values,
        "matrices",
        lambda column: Vt.Matrix4dArray.FromNumpy(np.ascontiguousarray(column, np.float64)),
    )


def forget_usd_splat_order(patch: pytest.MonkeyPatch) -> None:
    from exporters.usd import values

    patch.setattr(values, "xyzw", lambda quats_wxyz, dtype: quats_wxyz.astype(dtype))


def turn_harmonics_backwards(patch: pytest.MonkeyPatch) -> None:
    from exporters import harmonics

    rotate_each = harmonics.rotate_each
    patch.setattr(
        harmonics, "rotate_each", lambda sh, quats: rotate_each(sh, quats * [1, -1, -1, -1])
    )


def keep_harmonics_in_ply_rows(patch: pytest.MonkeyPatch) -> None:
    """Coefficient by coefficient, as in memory, where INRIA's layout goes channel by channel."""
    from exporters.ply import layout

    rest_rows = layout.rest_rows

    def mistaken(clip: Clip) -> np.ndarray:
        rows = rest_rows(clip)
        rest = clip.splats.sh_coeffs[:, 1:]
        rows[:, 9 : 9 + rest[0].size] = rest.reshape(len(rest), -1)
        return rows

    patch.setattr(layout, "rest_rows", mistaken)


CONVERSION_MUTANTS = {
    "glTF quaternions as wxyz": ConversionMutant(
        patches=forget_gltf_quaternion_order, form="gltf", shows_at="/rotation_xyzw"
    ),
    "glTF matrices as rows": ConversionMutant(
        patches=forget_gltf_matrix_order, form="gltf", shows_at="/inverse_bind_matrices/values"
    ),
    "glTF in Z-up centimeters": ConversionMutant(
        patches=forget_gltf_axes_and_unit,
        form="gltf",
        shows_at="/POSITION/values",
        case="z_up_centimeters",
    ),
    "USD quaternions as wxyz": ConversionMutant(
        patches=forget_usd_quaternion_order, form="usd", shows_at="/rotations/samples"
    ),
    "USD matrices as columns": ConversionMutant(
        patches=forget_usd_matrix_order, form="usd", shows_at="/bindTransforms/default"
    ),
    "glTF parts with quaternions as wxyz": ConversionMutant(
        patches=forget_gltf_quaternion_order, form="gltf_parts", shows_at="/part"
    ),
    "USD splats with quaternions as wxyz": ConversionMutant(
        patches=forget_usd_splat_order, form="cache", shows_at="/orientations/samples"
    ),
    "splats in a USD rig with quaternions as wxyz": ConversionMutant(
        patches=forget_usd_splat_order,
        form="usd_sibling",
        shows_at="/Splats/attributes/orientations/samples",
    ),
    "harmonics turned backwards": ConversionMutant(
        patches=turn_harmonics_backwards,
        form="cache_rotated",
        shows_at="/radiance:sphericalHarmonicsCoefficients/samples",
        case="z_up_centimeters",
    ),
    "PLY harmonics by coefficient": ConversionMutant(
        patches=keep_harmonics_in_ply_rows, form="ply", shows_at="/rows"
    ),
}
"""Mistakes in a conversion: the clip is right, the file is not."""
