"""Matcher `roma`: adapter to RoMa (Edstedt et al., CVPR 2024); the user brings the weights."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch

from animator.errors import InputError
from animator.match.local_affine import agreeing_matches
from animator.match.protocol import FlowField, MaskedImage
from animator.match.sampling import inside_mask
from animator.match.trust import NormalizedPair, TrustLimits, trusted_flow
from animator.match.window import Window, untrusted_flow, window_around
from animator.match.xfeat import drop_disagreeing
from animator.types import Matches

MIN_CERTAINTY = 0.05
"""RoMa's own threshold, below which its sampler never draws."""
SAMPLE_COUNT = 5000
"""Matches drawn by `match`."""

_SAMPLE_SEED = (
    0  # RoMa's sampler draws from torch's global generator; a fixed seed makes it repeatable
)
_COARSE_SIDE_PX = 560  # the resolutions of the published weights
_FINE_SIDE_PX = 864

_log = logging.getLogger(__name__)


class RomaModel(Protocol):
    """The three methods of a `romatch` model that the adapter uses."""

    def match(
        self, image_a: Any, image_b: Any, *, device: Any
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the warp, shape (1, H, 2 W, 4) or (H, 2 W, 4), and its certainty.

        The left half holds (x_a, y_a, x_b, y_b) for each pixel of A, the right half the same four
        for B, all in -1..1 from image edge to image edge (`symmetric=True`, RoMa's default).
        """
        ...

    def sample(
        self, warp: torch.Tensor, certainty: torch.Tensor, *, num: int
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Draw matches, shape (N, 4), and their certainty, shape (N,), spread over the image."""
        ...

    def to_pixel_coordinates(
        self, matches: torch.Tensor, height_a: int, width_a: int, height_b: int, width_b: int
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Map -1..1 to pixels from edge to edge, which is this project's +0.5 convention."""
        ...


class RomaMatcher:
    """Dense learned matching: the paper's matcher. Slow on a CPU, meant for CUDA."""

    name = "roma"

    def __init__(
        self,
        model: RomaModel,
        *,
        device: torch.device | str = "cpu",
        limits: TrustLimits | None = None,
    ):
        """Wrap a model.

        Args:
            model: A `romatch` model; see `load_roma`.
            device: Where it runs.
            limits: When to trust a displacement. The paper closes round trips to 10 px; the default
                here is 4 px, and the correlation decides the rest.
        """
        self._model = model
        self._device = torch.device(device)
        self._limits = limits or TrustLimits(round_trip_px=4.0)

    def flow(self, source: MaskedImage, target: MaskedImage) -> FlowField:
        """Match densely; see `Matcher.flow`.

        Raises:
            ValueError: If the images differ in size.
        """
        window = window_around(source, target)
        if window is None:
            return untrusted_flow(source, self.name)
        source_cut, target_cut = window.cut(source), window.cut(target)
        warp, certainty = self._match(source_cut, target_cut)
        flow = _dense_flow(warp, certainty, source_cut, target_cut, self._limits, self.name)
        return window.paste(drop_disagreeing(flow), source, target)

    def match(self, source: MaskedImage, target: MaskedImage) -> Matches:
        """Draw matches with RoMa's balanced sampler; see `Matcher.match`."""
        window = window_around(source, target)
        if window is None:
            nowhere = np.zeros((0, 2), np.float32)
            return Matches(
                source_px=nowhere, target_px=nowhere, confidences=np.zeros(0, np.float32)
            )
        source_cut, target_cut = window.cut(source), window.cut(target)
        warp, certainty = self._match(source_cut, target_cut)
        height, width = source_cut.mask.shape
        with torch.random.fork_rng(devices=[]), torch.no_grad():
            torch.manual_seed(_SAMPLE_SEED)
            drawn, drawn_certainty = self._model.sample(warp, certainty, num=SAMPLE_COUNT)
            pixels = self._model.to_pixel_coordinates(drawn, height, width, height, width)
        source_px, target_px = (part.cpu().numpy().astype(np.float32) for part in pixels)
        kept = inside_mask(source_cut.mask, source_px) & inside_mask(target_cut.mask, target_px)
        kept[kept] = agreeing_matches(source_px[kept], target_px[kept])
        return _in_image(
            window, source_px[kept], target_px[kept], drawn_certainty.cpu().numpy()[kept]
        )

    def _match(self, source: MaskedImage, target: MaskedImage) -> tuple[torch.Tensor, torch.Tensor]:
        from PIL import Image

        with torch.no_grad():
            warp, certainty = self._model.match(
                Image.fromarray(source.rgb), Image.fromarray(target.rgb), device=self._device
            )
        # Releases differ in whether there is a batch axis.
        return warp.reshape(warp.shape[-3:]), certainty.reshape(certainty.shape[-2:])


def load_roma(weights: Sequence[Path], *, device: torch.device | str = "cpu") -> RomaMatcher:
    """Build RoMa from weight files on disk; nothing is downloaded.

    Args:
        weights: `roma_outdoor.pth` (or `roma_indoor.pth`) and `dinov2_vitl14_pretrain.pth`, in any
            order.
        device: Where to run.

    Returns:
        The matcher.

    Raises:
        InputError: If a file is missing or not what it should be, or `romatch` is not installed.
    """
    roma_state, dino_state = _read_states(weights)
    try:
        from romatch import roma_outdoor  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise InputError(
            f"--matcher roma: the package romatch cannot be imported ({error}); "
            "install it with `pip install splatimate[roma]`, or use --matcher auto"
        ) from error
    model = roma_outdoor(
        device=torch.device(device),
        weights=roma_state,
        dinov2_weights=dino_state,
        coarse_res=_COARSE_SIDE_PX,
        upsample_res=_FINE_SIDE_PX,
        use_custom_corr=False,  # the default needs a separately compiled package
    )
    if torch.device(device).type == "cpu":
        _log.warning("RoMa on a CPU takes minutes a pair; --matcher auto takes about a second")
    return RomaMatcher(model, device=device)


def _read_states(weights: Sequence[Path]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return RoMa's and DINOv2's state dicts, told apart by what is in them."""
    expected = (
        "expected two files, roma_outdoor.pth and dinov2_vitl14_pretrain.pth "
        "(links in the README of github.com/Parskatt/RoMa); nothing is downloaded for you"
    )
    if len(weights) != 2:
        raise InputError(f"--roma-weights: {expected}; got {len(weights)} file(s)")
    states = []
    for path in weights:
        if not path.is_file():
            raise InputError(f"--roma-weights: {path} is not a file; {expected}")
        try:
            state = torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:  # torch raises many types for a damaged or unsafe file
            raise InputError(
                f"--roma-weights: {path} is not a plain PyTorch state dict ({error}); {expected}"
            ) from error
        if not isinstance(state, dict):
            raise InputError(
                f"--roma-weights: {path} holds a {type(state).__name__}, not a state dict; "
                f"{expected}"
            )
        states.append(state)
    # DINOv2 is a bare vision transformer with a class token; RoMa's names start with encoder and
    # decoder.
    is_dino = ["cls_token" in state for state in states]
    if sum(is_dino) != 1:
        found = "two DINOv2 files" if all(is_dino) else "no DINOv2 file (one with a `cls_token`)"
        raise InputError(f"--roma-weights: {expected}; got {found}")
    return states[is_dino.index(False)], states[is_dino.index(True)]


def _dense_flow(
    warp: torch.Tensor,
    certainty: torch.Tensor,
    source: MaskedImage,
    target: MaskedImage,
    limits: TrustLimits,
    name: str,
) -> FlowField:
    """Turn a warp in -1..1 into a trusted flow at the images' resolution."""
    import cv2

    height, width = source.mask.shape
    half_sizes = np.array([width, height], np.float32) / 2
    values = warp.float().cpu().numpy()
    column_count = values.shape[1] // 2
    there, back = values[:, :column_count], values[:, column_count:]
    forward = cv2.resize((there[..., 2:] - there[..., :2]) * half_sizes, (width, height))
    backward = cv2.resize((back[..., :2] - back[..., 2:]) * half_sizes, (width, height))
    trust = cv2.resize(certainty.float().cpu().numpy()[:, :column_count], (width, height))
    pair = NormalizedPair.of(source, target)
    flow = trusted_flow(pair, (forward, backward), limits=limits, matcher=name)
    trust[trust < MIN_CERTAINTY] = 0
    return FlowField(
        flow_px=flow.flow_px,
        confidences=flow.confidences * np.clip(trust, 0, 1),
        matcher=name,
    )


def _in_image(
    window: Window, source_px: np.ndarray, target_px: np.ndarray, certainties: np.ndarray
) -> Matches:
    return Matches(
        source_px=window.to_image(source_px).astype(np.float32),
        target_px=window.to_image(target_px).astype(np.float32),
        confidences=np.clip(certainties, 0, 1).astype(np.float32),
    )
