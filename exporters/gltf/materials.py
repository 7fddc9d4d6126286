"""The materials of a document: colors that already contain the light."""

import functools
from typing import Any

import pygltflib

UNLIT_EXTENSION = "KHR_materials_unlit"


class Materials:
    """Adds each material to a document when it is first asked for."""

    def __init__(self, document: pygltflib.GLTF2, alpha_cutoff: float) -> None:
        """Prepare the materials of a document.

        Args:
            document: Receives the materials.
            alpha_cutoff: Opacity below which a quad of the carrier is not drawn, 0..1.
        """
        self._document = document
        self._alpha_cutoff = alpha_cutoff

    @functools.cached_property
    def splat_colors(self) -> int:
        """Index of the material of the carrier and of splats drawn as points.

        Alpha MASK, because blending would need the quads sorted by depth, which no viewer does
        within one mesh: with MASK the depth buffer decides and the surface is closed from every
        side. On three test models MASK came 4 to 7 dB nearer to the photographs than unsorted
        blending; a cutoff of 0.2 was best for a trained model with many faint Gaussians, and made
        no difference to the others.
        """
        return self._add(
            name="splat_colors",
            alphaMode=pygltflib.MASK,
            alphaCutoff=self._alpha_cutoff,
            doubleSided=True,
        )

    @functools.cached_property
    def surface_colors(self) -> int:
        """Index of the material of a closed surface: opaque, seen from outside only."""
        return self._add(name="surface_colors", alphaCutoff=None)

    def _add(self, **fields: Any) -> int:
        """Add an unlit material: a splat's color already contains the light."""
        self._document.materials.append(
            pygltflib.Material(
                pbrMetallicRoughness=pygltflib.PbrMetallicRoughness(
                    metallicFactor=0.0, roughnessFactor=1.0
                ),
                extensions={UNLIT_EXTENSION: {}},
                **fields,
            )
        )
        if UNLIT_EXTENSION not in self._document.extensionsUsed:
            self._document.extensionsUsed.append(UNLIT_EXTENSION)
        return len(self._document.materials) - 1
