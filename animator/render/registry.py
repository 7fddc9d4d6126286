"""The renderers by device, imported only when asked for."""

import importlib
import importlib.util
import logging
from typing import Literal

from animator.errors import InputError
from animator.render.protocol import Renderer

_log = logging.getLogger(__name__)

RENDERERS = {
    "cpu": "animator.render.cpu:CpuRenderer",
    "cuda": "animator.render.cuda:GsplatRenderer",
}
"""Import string of the renderer of each device."""


def load_renderer(device: Literal["auto", "cpu", "cuda"] = "auto") -> Renderer:
    """Return the renderer for a device; `auto` takes CUDA where it would work.

    Raises:
        InputError: If the device is unknown, or CUDA is asked for and cannot be used.
    """
    if device == "auto":
        obstacle = _cuda_obstacle()
        device = "cpu" if obstacle else "cuda"
        _log.info("rendering on the %s%s", device.upper(), f": {obstacle}" if obstacle else "")
    elif device == "cuda" and (obstacle := _cuda_obstacle()):
        raise InputError(f"--device cuda: {obstacle}; or use --device cpu")
    elif device not in RENDERERS:
        expected = ", ".join(["auto", *RENDERERS])
        raise InputError(f"--device: expected one of {expected}, found {device!r}")
    module_name, class_name = RENDERERS[device].split(":")
    return getattr(importlib.import_module(module_name), class_name)()


def _cuda_obstacle() -> str:
    """Say what keeps CUDA from being used and what to do about it; empty if nothing does."""
    import torch

    if not torch.cuda.is_available():
        return (
            "torch finds no CUDA device; check the driver with nvidia-smi and install torch's "
            "CUDA build from pytorch.org"
        )
    if importlib.util.find_spec("gsplat") is None:
        return "gsplat is not installed; run: pip install 'splatimate[gpu]'"
    return ""
