"""A saved layer, and what it refers to, as a .usdz."""

import os
import time
from pathlib import Path

from pxr import Sdf

from exporters.errors import WriteError

_LOCAL_TIME = (1980, 1, 2, 0, 0, 0, 0, 0, -1)
"""What each file in the package is dated: the earliest day that a zip can hold in every time zone."""


def pack(layer_path: Path, package_path: Path) -> None:
    """Pack a layer and all that lies beside it into a .usdz: 64-byte aligned, nothing compressed.

    One binary layer is packed as ARKit wants it; with further layers, a payload, the package is a
    general one, for ARKit takes no second layer and flattening would end the payload.

    Args:
        layer_path: The root layer, `.usdc`, alone in its folder with what it refers to.
        package_path: The target, `.usdz`, not yet there.

    Raises:
        WriteError: If USD cannot pack it.
    """
    from pxr import UsdUtils  # which other files need not wait for

    parts = [path for path in sorted(layer_path.parent.iterdir()) if path != package_path]
    # A zip stores local time: this moment is written alike everywhere, so that the bytes are too.
    moment_s = time.mktime(_LOCAL_TIME)
    for part in parts:
        os.utime(part, (moment_s, moment_s))
    has_one_layer = sum(part.suffix == ".usdc" for part in parts) == 1
    create = UsdUtils.CreateNewARKitUsdzPackage if has_one_layer else UsdUtils.CreateNewUsdzPackage
    if not create(Sdf.AssetPath(str(layer_path)), str(package_path)):
        raise WriteError(f"{package_path.name}: USD could not pack {layer_path.name}")
