"""Which of many known views a frame looks most like."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from animator.match.features import FeatureMatcher
from animator.match.protocol import MaskedImage
from animator.types import Matches

CELLS_PER_SIDE = 32
"""Cells along the object's longer side; for 640 px they are the paper's 20 px."""
SHORTLIST_COUNT = 5
"""Views that are matched with the strong matcher."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class RankedView:
    """How well one view matches the frame."""

    index: int
    """Position in the sequence of views."""
    cell_count: int
    """Cells of the frame that hold a match."""
    matches: Matches | None
    """Matches from the view to the frame, for shortlisted views; None for the others."""


def rank_views(
    views: Sequence[MaskedImage],
    frame: MaskedImage,
    *,
    features: FeatureMatcher,
    shortlist_count: int = SHORTLIST_COUNT,
) -> list[RankedView]:
    """Rank views by how many cells of the frame's object hold a match: spread counts, not number.

    All views are matched by mutual nearest neighbours, the best few again by LighterGlue; those few
    come first. Ties go to the view that had more cells in the first pass, then to the lower index.

    Args:
        views: Renders of the object from known cameras; sizes may differ.
        frame: The image whose view is wanted.
        features: Feature extractor.
        shortlist_count: How many views to match again.

    Returns:
        All views, the best first.
    """
    frame_features = features.extract(frame)
    view_features = [features.extract(view) for view in views]
    first_counts = [
        occupied_cells(features.match_mutual(view, frame_features), frame) for view in view_features
    ]
    order = sorted(range(len(views)), key=lambda index: (-first_counts[index], index))
    shortlisted = []
    for index in order[:shortlist_count]:
        matches = features.match(view_features[index], frame_features)
        count = occupied_cells(matches, frame)
        shortlisted.append(RankedView(index=index, cell_count=count, matches=matches))
    shortlisted.sort(key=lambda view: (-view.cell_count, -first_counts[view.index], view.index))
    others = [
        RankedView(index=index, cell_count=first_counts[index], matches=None)
        for index in order[shortlist_count:]
    ]
    return shortlisted + others


def occupied_cells(matches: Matches, frame: MaskedImage) -> int:
    """Count the distinct square cells of the frame's object that hold a match."""
    left, top, right, bottom = frame.box_px
    side = max(right - left, bottom - top) / CELLS_PER_SIDE
    if len(matches) == 0 or side == 0:
        return 0
    cells = np.floor((matches.target_px - np.array([left, top])) / side).astype(np.int64)
    return len(np.unique(cells, axis=0))
