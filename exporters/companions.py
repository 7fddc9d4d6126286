"""The names of the files that a writer puts beside the one it was asked for."""

from pathlib import Path

from exporters.options import ExportOptions

_USD_LAYERS = (".usd", ".usda", ".usdc")
"""A .usdz holds all it needs."""


def companions(path: Path, options: ExportOptions) -> tuple[Path, ...]:
    """Return the further files of an asset, in the order of the formats' own names."""
    suffix = path.suffix.lower()
    found = []
    if suffix == ".gltf":
        found.append(buffer_path(path))
    if suffix in _USD_LAYERS and options.usd_splats == "payload":
        found.append(payload_path(path))
    if suffix in _USD_LAYERS and options.texture and options.mesh in ("surface", "both"):
        found.append(texture_path(path))
    return tuple(found)


def buffer_path(path: Path) -> Path:
    """Return the binary of a .gltf."""
    return path.with_suffix(".bin")


def payload_path(path: Path) -> Path:
    """Return the layer of the moving splats of a USD asset."""
    return path.with_name(f"{path.stem}_splats.usdc")


def texture_path(path: Path) -> Path:
    """Return the texture of a USD asset's surface."""
    return path.with_name(f"{path.stem}_colors.png")
