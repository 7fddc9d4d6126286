"""Local normalisation: remove slow changes of light, which render and photograph never share."""

import numpy as np

from animator.match.protocol import MaskedImage

BLUR_PX = 12.0
"""Standard deviation of the neighbourhood [px], measured best of those tried at 512 px."""
CONTRAST_FLOOR = 6.0
"""Added to the local deviation [grey levels]: noise on plain surfaces is not blown up."""
NEUTRAL = 128
"""Grey level of the local mean, and of everything outside the mask."""
GAIN = 40.0
"""Grey levels per local standard deviation."""


def normalize_locally(image: MaskedImage, *, blur_px: float = BLUR_PX) -> np.ndarray:
    """Replace each grey value by how many local standard deviations it is above its local mean.

    The local moments are masked averages, so the background has no say: with weights w (the mask)
    and a Gaussian blur G, mean = G(w g) / G(w) and variance = G(w g^2) / G(w) - mean^2.

    Args:
        image: Image and mask, sizes (H, W).
        blur_px: Standard deviation of the neighbourhood [px].

    Returns:
        128 + 40 (g - mean) / (deviation + 6), clipped, and 128 outside the mask; uint8, shape (H,
        W).
    """
    import cv2

    gray = cv2.cvtColor(image.rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
    weights = image.mask.astype(np.float32)

    def blur(values: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(values, (0, 0), blur_px)

    total = blur(weights) + 1e-3
    mean = blur(gray * weights) / total
    variance = np.maximum(blur(gray * gray * weights) / total - mean * mean, 0)
    normalized = NEUTRAL + GAIN * (gray - mean) / (np.sqrt(variance) + CONTRAST_FLOOR)
    normalized[~image.mask] = NEUTRAL
    return np.clip(np.rint(normalized), 0, 255).astype(np.uint8)
