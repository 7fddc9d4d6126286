"""Which meshes carry the skin of a clip, by the user's choice."""

from exporters.carrier import carrier_quads
from exporters.clip import Clip
from exporters.options import ExportOptions
from exporters.skinned_mesh import SkinnedMesh


def meshes_of(clip: Clip, options: ExportOptions) -> tuple[SkinnedMesh, ...]:
    """Return the meshes that `options.mesh` asks for, in the axes and unit of the clip.

    Args:
        clip: A valid clip.
        options: `mesh` chooses, `faces` bounds the triangles of the surface.

    Returns:
        `surface`, `carrier`, both in this order, or none.

    Raises:
        ClipError: If there is no surface: Gaussians too faint, or too few triangles allowed.
    """
    meshes = []
    if options.mesh in ("surface", "both"):
        from exporters.surface.control_mesh import control_mesh

        meshes.append(control_mesh(clip, options.faces))
    if options.mesh in ("quads", "both"):
        meshes.append(carrier_quads(clip.splats, clip.skin))
    return tuple(meshes)
