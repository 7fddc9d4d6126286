"""LPIPS with AlexNet: the distance of two pictures in the eyes of a network.

Zhang et al., The Unreasonable Effectiveness of Deep Features as a Perceptual Metric, CVPR 2018,
version 0.1 of https://github.com/richzhang/PerceptualSimilarity. Nothing is downloaded: the user
brings the features, torchvision's `alexnet-owt-7be5be79.pth`, and the linear layers on top, `alex.pth`
(lpips/weights/v0.1 in that repository).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from torch import nn

from animator.errors import InputError

_SHIFT = (-0.030, -0.088, -0.188)
_SCALE = (0.458, 0.448, 0.450)
"""ScalingLayer: ImageNet's mean and deviation for colors in -1..1."""
_EPSILON = 1e-10
_STAGES = ((0, 2), (2, 5), (5, 8), (8, 10), (10, 12))
"""Layers of AlexNet's features from one judged activation to the next."""
_LINEAR = tuple(f"lin{k}.model.1.weight" for k in range(len(_STAGES)))
_FEATURES = tuple(f"features.{k}.{kind}" for k in (0, 3, 6, 8, 10) for kind in ("weight", "bias"))


class Lpips(nn.Module):
    """The network: five stages of AlexNet, and how much each of their channels counts."""

    def __init__(self) -> None:
        super().__init__()
        self.features = nn.Sequential(
            nn.Conv2d(3, 64, kernel_size=11, stride=4, padding=2),
            nn.ReLU(),
            nn.MaxPool2d(kernel_size=3, stride=2),
            nn.Conv2d(64, 192, kernel_size=5, padding=2),
            nn.ReLU(),
            nn.MaxPool2d(kernel_size=3, stride=2),
            nn.Conv2d(192, 384, kernel_size=3, padding=1),
            nn.ReLU(),
            nn.Conv2d(384, 256, kernel_size=3, padding=1),
            nn.ReLU(),
            nn.Conv2d(256, 256, kernel_size=3, padding=1),
            nn.ReLU(),
        )
        widths = (64, 192, 384, 256, 256)
        self.channel_weights = [torch.zeros(1, width, 1, 1) for width in widths]

    def load(self, weights: Mapping[str, torch.Tensor]) -> None:
        """Take the tensors of both files."""
        own = {name: weights[name] for name in _FEATURES}
        self.load_state_dict(own)
        self.channel_weights = [weights[name] for name in _LINEAR]

    @torch.no_grad()
    def forward(self, drawn: np.ndarray, true: np.ndarray) -> float:
        """Compare two pictures, sRGB 0..1, shape (H, W, 3)."""
        first, second = (self._scaled(image) for image in (drawn, true))
        total = 0.0
        for (start, end), channel_weights in zip(_STAGES, self.channel_weights, strict=True):
            first, second = (self.features[start:end](image) for image in (first, second))
            squared = (_unit(first) - _unit(second)).square()
            total += float((squared * channel_weights).sum(dim=1).mean())
        return total

    def _scaled(self, image: np.ndarray) -> torch.Tensor:
        tensor = torch.from_numpy(np.ascontiguousarray(image, np.float32)).permute(2, 0, 1)[None]
        shift = tensor.new_tensor(_SHIFT)[None, :, None, None]
        return (2 * tensor - 1 - shift) / tensor.new_tensor(_SCALE)[None, :, None, None]


def load_lpips(paths: Sequence[Path]) -> Lpips:
    """Build the network from weight files.

    Args:
        paths: State dicts of torch, read without pickled code; together they hold AlexNet's
            features and the linear layers.

    Raises:
        InputError: If a file cannot be read, or weights are missing or of another shape.
    """
    weights: dict[str, torch.Tensor] = {}
    for path in paths:
        try:
            weights |= torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:  # torch raises half a dozen types on what is no weight file
            raise InputError(
                f"{path}: --lpips-weights: expected a state dict of torch, cannot be read: {error}"
            ) from error
    missing = [name for name in (*_FEATURES, *_LINEAR) if name not in weights]
    if missing:
        raise InputError(
            f"--lpips-weights: {', '.join(missing[:4])} and {max(len(missing) - 4, 0)} more are "
            "missing; give both files, torchvision's AlexNet (alexnet-owt-*.pth) and the layers of "
            "LPIPS 0.1 (alex.pth)."
        )
    network = Lpips().eval()
    try:
        network.load(weights)
    except RuntimeError as error:
        raise InputError(f"--lpips-weights: these are not AlexNet's: {error}") from error
    return network


def _unit(features: torch.Tensor) -> torch.Tensor:
    return features / (features.square().sum(dim=1, keepdim=True).sqrt() + _EPSILON)
