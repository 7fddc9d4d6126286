"""Dense inverse search flow (Kroeger et al., ECCV 2016) between locally normalised images."""

import numpy as np

from animator.match.sampling import warp


def dis_flow(source_gray: np.ndarray, target_gray: np.ndarray) -> np.ndarray:
    """Estimate the flow from source to target with DIS at its medium preset.

    Args:
        source_gray: uint8, shape (H, W), at least 16 px on a side.
        target_gray: uint8, shape (H, W).

    Returns:
        Displacement of each source pixel [px], float32, shape (H, W, 2).
    """
    import cv2

    # OpenCV 4 and 5 name the constructor differently in their stubs, both have this one.
    estimator = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)  # pyright: ignore
    return estimator.calc(source_gray, target_gray, None)


def refine_flow(
    source_gray: np.ndarray, target_gray: np.ndarray, flow_px: np.ndarray, *, rounds: int
) -> np.ndarray:
    """Improve a flow: warp the target by it, measure what is left, compose.

    DIS patches only translate. Seen through the warp, rotation and scale are already undone, so the
    remainder is small; with remainder r the composition is f'(x) = f(x + r(x)) + r(x).

    Args:
        source_gray: uint8, shape (H, W).
        target_gray: uint8, shape (H, W).
        flow_px: First guess [px], float32, shape (H, W, 2).
        rounds: How often to repeat, 0 returns the guess.

    Returns:
        The refined flow [px], float32, shape (H, W, 2).
    """
    for _ in range(rounds):
        remainder = dis_flow(source_gray, warp(target_gray, flow_px))
        flow_px = warp(flow_px, remainder) + remainder
    return flow_px
