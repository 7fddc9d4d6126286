"""Which displacements of a flow to believe: the round trip, the look of both ends, the masks."""

import dataclasses

import numpy as np

from animator.match.dis import dis_flow, refine_flow
from animator.match.local_normalization import normalize_locally
from animator.match.protocol import FlowField, MaskedImage
from animator.match.sampling import inside_mask, pixel_centers, warp

_VARIANCE_FLOOR = 4.0  # [grey levels^2]: two plain patches agree, they do not divide noise by noise


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrustLimits:
    """When a displacement is believed."""

    round_trip_px: float = 1.5
    """Largest distance to where source -> target -> source ends [working px]."""
    correlation: float = 0.5
    """Smallest normalised cross-correlation of the two neighbourhoods."""
    correlation_blur_px: float = 4.0
    """Standard deviation of those neighbourhoods [working px]."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class NormalizedPair:
    """Two images of one window, ready for optical flow."""

    source_gray: np.ndarray
    """Locally normalised source, uint8, shape (H, W)."""
    target_gray: np.ndarray
    """Locally normalised target, uint8, shape (H, W)."""
    source_mask: np.ndarray
    """True on the object, bool, shape (H, W)."""
    target_mask: np.ndarray
    """True on the object, bool, shape (H, W)."""

    @classmethod
    def of(cls, source: MaskedImage, target: MaskedImage) -> "NormalizedPair":
        """Normalise both images."""
        return cls(
            source_gray=normalize_locally(source),
            target_gray=normalize_locally(target),
            source_mask=source.mask,
            target_mask=target.mask,
        )

    def flows(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the flow to the target and the flow back, from nothing, each shape (H, W, 2)."""
        return (
            dis_flow(self.source_gray, self.target_gray),
            dis_flow(self.target_gray, self.source_gray),
        )

    def refined(
        self, flows: tuple[np.ndarray, np.ndarray], *, rounds: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return both flows after some rounds of warping and matching again."""
        forward, backward = flows
        return (
            refine_flow(self.source_gray, self.target_gray, forward, rounds=rounds),
            refine_flow(self.target_gray, self.source_gray, backward, rounds=rounds),
        )


def round_trip_error(forward_px: np.ndarray, backward_px: np.ndarray) -> np.ndarray:
    """Measure how far from its start each source pixel ends after going there and back.

    Args:
        forward_px: Flow source -> target [px], shape (H, W, 2).
        backward_px: Flow target -> source [px], shape (H, W, 2).

    Returns:
        Distances [px], float32, shape (H, W).
    """
    return np.linalg.norm(forward_px + warp(backward_px, forward_px), axis=-1)


def local_correlation(
    source_gray: np.ndarray, target_gray: np.ndarray, forward_px: np.ndarray, *, blur_px: float
) -> np.ndarray:
    """Correlate each source neighbourhood with where the flow says it went.

    Args:
        source_gray: uint8, shape (H, W).
        target_gray: uint8, shape (H, W).
        forward_px: Flow source -> target [px], shape (H, W, 2).
        blur_px: Standard deviation of the neighbourhood [px].

    Returns:
        Normalised cross-correlation, -1..1, float32, shape (H, W); 1 where both sides are plain.
    """
    import cv2

    def blur(values: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(values, (0, 0), blur_px)

    source = source_gray.astype(np.float32)
    target = warp(target_gray, forward_px).astype(np.float32)
    source_mean, target_mean = blur(source), blur(target)
    source_variance = np.maximum(blur(source * source) - source_mean * source_mean, 0)
    target_variance = np.maximum(blur(target * target) - target_mean * target_mean, 0)
    covariance = blur(source * target) - source_mean * target_mean
    scale = np.sqrt((source_variance + _VARIANCE_FLOOR) * (target_variance + _VARIANCE_FLOOR))
    return np.clip((covariance + _VARIANCE_FLOOR) / scale, -1, 1)


def trusted_flow(
    pair: NormalizedPair,
    flows: tuple[np.ndarray, np.ndarray],
    *,
    limits: TrustLimits,
    matcher: str,
) -> FlowField:
    """Attach to a forward flow the trust that its backward flow and the images give it.

    A displacement is trusted if it starts and lands on the object, the round trip closes and both
    ends look alike; the trust is then the correlation, lowered to half at the largest round trip
    allowed.

    Args:
        pair: The two images.
        flows: Flow source -> target and flow target -> source [px], each shape (H, W, 2).
        limits: When to trust.
        matcher: Name to put on the result.

    Returns:
        The forward flow with its confidences.
    """
    forward, backward = flows
    error = round_trip_error(forward, backward)
    correlation = local_correlation(
        pair.source_gray, pair.target_gray, forward, blur_px=limits.correlation_blur_px
    )
    landing = pixel_centers(*pair.source_mask.shape) + forward
    lands_on_object = inside_mask(pair.target_mask, landing.reshape(-1, 2))
    trusted = pair.source_mask & lands_on_object.reshape(pair.source_mask.shape)
    trusted &= (error < limits.round_trip_px) & (correlation > limits.correlation)
    confidences = correlation * (1 - 0.5 * error / limits.round_trip_px)
    return FlowField(
        flow_px=forward.astype(np.float32, copy=False),
        confidences=np.where(trusted, confidences, 0).astype(np.float32),
        matcher=matcher,
    )
