"""Which versions of what are installed."""

import importlib.metadata
import platform

_PACKAGES = ("numpy", "torch", "numba", "opencv-contrib-python-headless", "scipy", "usd-core")


def program_version() -> str:
    """Return the version of splatimate."""
    return _version("splatimate") or "0+uninstalled"


def package_versions() -> dict[str, str]:
    """Return the versions that a result may depend on, of those that are installed."""
    versions = {"splatimate": program_version(), "python": platform.python_version()}
    for name in _PACKAGES:
        version = _version(name)
        if version is not None:
            versions[name] = version
    return versions


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
