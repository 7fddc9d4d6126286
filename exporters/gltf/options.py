"""What goes into a glTF file."""

import dataclasses


@dataclasses.dataclass(frozen=True, kw_only=True)
class GltfOptions:
    """Choices of the user; the defaults suit both mesh viewers and splat viewers."""

    rest_splats: bool = True
    """Also write the exact splats at rest, in a second scene (see `exporters.gltf.splats`)."""
    alpha_cutoff: float = 0.2
    """Carrier quads fainter than this are not drawn, 0..1 (see `exporters.gltf.carrier_mesh`)."""
