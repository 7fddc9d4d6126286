"""Unexplained pixels claim unexplained Gaussians: finds limbs that appear, or that matching lost.

Flow cannot follow what it does not see: an arm that comes out from behind the body, or moves too
fast. Then the frame has pixels that no Gaussian explains, and the splat has Gaussians that explain
no pixel, because they are hidden or drawn where the frame shows something else. These are paired by
place and color; what is already explained takes no part, so that no body is stretched over a limb.
"""

import dataclasses

import numpy as np
from scipy.spatial import KDTree

from animator.match.unexplained import UNEXPLAINED, CoveredImage, unexplained_pixels
from animator.types import SOLID_OPACITY, GaussianMatches

_FEWEST = 5
"""Fewer pixels or Gaussians than this are noise."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClaimConfig:
    """What counts as unexplained, and how far a claim reaches."""

    error: float = UNEXPLAINED
    """Difference of color plus coverage, 0..2, above which a pixel is unexplained."""
    min_area: float = 0.01
    """Unexplained share of the silhouette below which nothing is claimed."""
    hidden_share: float = 0.05
    """A Gaussian of which less is visible counts as hidden."""
    reach: float = 0.12
    """Longest claim [share of the object's size in the image], for Gaussians of the pixel's color."""
    color_reach: float = 0.5
    """Largest difference of color, as a length in RGB, for Gaussians at the pixel itself."""
    max_pixels: int = 600
    """Pixels that claim."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class DrawnGaussians:
    """The Gaussians as the render shows them, N of them."""

    centers_px: np.ndarray
    """Projected centers, pixel centers at +0.5, shape (N, 2)."""
    depths: np.ndarray
    """Depth along +z [scene unit], shape (N,)."""
    visible_shares: np.ndarray
    """How much of each is seen, 0..1, shape (N,)."""
    opacities: np.ndarray
    """Opacities 0..1, shape (N,)."""
    colors: np.ndarray
    """Colors as seen by the camera, shape (N, 3)."""


def find_claims(
    render: CoveredImage,
    frame: CoveredImage,
    drawn: DrawnGaussians,
    object_px: float,
    config: ClaimConfig,
    rng: np.random.Generator,
) -> GaussianMatches | None:
    """Pair pixels that no Gaussian explains with Gaussians that explain no pixel.

    Args:
        render: The splat in its present pose.
        frame: What it should look like.
        drawn: The Gaussians of the render.
        object_px: Size of the object in the image [px].
        config: What counts as unexplained.
        rng: Chooses the pixels where there are too many.

    Returns:
        Each claimed Gaussian with the mean of the pixels that claim it, trusted by their number; None if the
        frame is explained well enough, or nothing is left to explain it with.
    """
    unexplained = unexplained_pixels(render, frame, error=config.error)
    wanted = np.argwhere(unexplained & frame.is_covered)
    if len(wanted) < max(config.min_area * frame.is_covered.sum(), _FEWEST):
        return None
    free_ids = np.flatnonzero(_is_free(drawn, unexplained, config))
    if len(free_ids) < _FEWEST:
        return None
    if len(wanted) > config.max_pixels:
        wanted = wanted[np.sort(rng.choice(len(wanted), config.max_pixels, replace=False))]
    pixels = wanted[:, ::-1] + 0.5
    reach_px = config.reach * object_px

    def place_and_color(places_px: np.ndarray, colors: np.ndarray) -> np.ndarray:
        return np.concatenate([places_px / reach_px, colors / config.color_reach], axis=1)

    tree = KDTree(place_and_color(drawn.centers_px[free_ids], drawn.colors[free_ids]))
    wanted_colors = frame.rgb[wanted[:, 0], wanted[:, 1]]
    distances, nearest = (
        np.asarray(found)
        for found in tree.query(place_and_color(pixels, wanted_colors), distance_upper_bound=1.0)
    )
    reached = np.isfinite(distances)
    if reached.sum() < _FEWEST:
        return None
    claimed, inverse, counts = np.unique(
        free_ids[nearest[reached]], return_inverse=True, return_counts=True
    )
    sums_px = np.zeros((len(claimed), 2))
    np.add.at(sums_px, inverse, pixels[reached])
    return GaussianMatches(
        gaussian_ids=claimed.astype(np.int64),
        target_px=sums_px / counts[:, None],
        confidences=counts / counts.max(),
    )


def _is_free(drawn: DrawnGaussians, unexplained: np.ndarray, config: ClaimConfig) -> np.ndarray:
    """Tell which solid Gaussians explain no pixel of the frame, bool, shape (N,)."""
    height, width = unexplained.shape
    columns, rows = np.floor(drawn.centers_px).T
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    inside &= drawn.depths > 0
    misses = ~inside
    at = rows[inside].astype(np.int64), columns[inside].astype(np.int64)
    misses[inside] = unexplained[at]
    hidden = drawn.visible_shares < config.hidden_share
    return (hidden | misses) & (drawn.opacities > SOLID_OPACITY)
