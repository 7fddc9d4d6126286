"""One picture to judge a run by: frames, renders, differences and rigid groups side by side."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from animator.report.measurement import FramePictures

COLUMNS = ("frame", "render", "difference", "rigid groups")
CELL_PX = 300
"""Longer side of one picture [px]."""
_MIN_CELL_WIDTH_PX = 125
"""Four of these hold a caption."""
_LINE_PX = 24
_GAP_PX = 4
_BACKGROUND = 32
_TEXT_BRIGHTNESS = 225
_MARGIN = 0.06
"""Room around the object [share of its box]."""


def contact_sheet(pictures: Sequence[FramePictures], captions: Sequence[str]) -> np.ndarray:
    """Lay the pictures out, a row a frame.

    All rows show the same window, the box of the object over all of them: motion stays visible,
    empty image does not take room.

    Args:
        pictures: The frames, at least one, all of one size.
        captions: One line for each.

    Returns:
        sRGB, uint8, shape (H, W, 3).
    """
    window = object_window([picture.is_object for picture in pictures])
    rows = [
        [image[window] for image in (shown.frame, shown.render, shown.difference, shown.groups)]
        for shown in pictures
    ]
    return picture_grid(COLUMNS, rows, captions)


def picture_grid(
    titles: Sequence[str], rows: Sequence[Sequence[np.ndarray]], captions: Sequence[str]
) -> np.ndarray:
    """Lay pictures out in rows and columns.

    Args:
        titles: One for each column.
        rows: Pictures of each row, uint8, shapes (H, W, 3); all cells are as large as the largest.
        captions: One line above each row.

    Returns:
        sRGB, uint8, shape (H, W, 3).
    """
    cell_size_px = _cell_size_px([image.shape for row in rows for image in row])
    cell_width_px, cell_height_px = cell_size_px
    row_px = _LINE_PX + cell_height_px + _GAP_PX
    width_px = len(titles) * (cell_width_px + _GAP_PX) + _GAP_PX
    sheet = np.full((_LINE_PX + len(rows) * row_px + _GAP_PX, width_px, 3), _BACKGROUND, np.uint8)
    for column, title in enumerate(titles):
        _write(sheet, title, _GAP_PX + column * (cell_width_px + _GAP_PX), 0)
    for row, (images, caption) in enumerate(zip(rows, captions, strict=True)):
        top = _LINE_PX + row * row_px
        _write(sheet, caption, _GAP_PX, top)
        for column, image in enumerate(images):
            left = _GAP_PX + column * (cell_width_px + _GAP_PX)
            cell = _resized(image, cell_size_px)
            sheet[top + _LINE_PX :, left:][:cell_height_px, :cell_width_px] = cell
    return sheet


def png_bytes(rgb: np.ndarray) -> bytes:
    """Encode an image as PNG; rgb is uint8, shape (H, W, 3)."""
    import cv2

    is_encoded, encoded = cv2.imencode(".png", np.ascontiguousarray(rgb[..., ::-1]))
    assert is_encoded, "OpenCV encodes any 8-bit image"
    return encoded.tobytes()


def write_png(rgb: np.ndarray, path: Path) -> None:
    """Write an image; replacing an old one whole is for the caller."""
    path.write_bytes(png_bytes(rgb))


def object_window(masks: Sequence[np.ndarray]) -> tuple[slice, slice]:
    """Return rows and columns of the box around all masks, with a margin."""
    union = np.logical_or.reduce(masks)
    rows, columns = np.nonzero(union)
    if len(rows) == 0:
        return slice(0, union.shape[0]), slice(0, union.shape[1])
    margin = 2 + round(_MARGIN * max(np.ptp(rows), np.ptp(columns)))
    return _widened(rows, margin, union.shape[0]), _widened(columns, margin, union.shape[1])


def _widened(positions: np.ndarray, margin: int, length: int) -> slice:
    first, last = int(positions.min()), int(positions.max())
    return slice(max(first - margin, 0), min(last + 1 + margin, length))


def _cell_size_px(shapes: Sequence[tuple[int, ...]]) -> tuple[int, int]:
    height_px, width_px = (max(shape[axis] for shape in shapes) for axis in (0, 1))
    scale = CELL_PX / max(width_px, height_px)
    return max(round(width_px * scale), _MIN_CELL_WIDTH_PX), max(round(height_px * scale), 1)


def _resized(image: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """Fit an image into a cell, keeping its aspect ratio, centered on black."""
    import cv2

    width_px, height_px = size_px
    scale = min(width_px / image.shape[1], height_px / image.shape[0])
    inner = max(round(image.shape[1] * scale), 1), max(round(image.shape[0] * scale), 1)
    inner = min(inner[0], width_px), min(inner[1], height_px)
    method = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    cell = np.zeros((height_px, width_px, 3), np.uint8)
    left, top = (width_px - inner[0]) // 2, (height_px - inner[1]) // 2
    resized = cv2.resize(np.ascontiguousarray(image), inner, interpolation=method)
    cell[top : top + inner[1], left : left + inner[0]] = resized
    return cell


def _write(sheet: np.ndarray, text: str, left_px: int, top_px: int) -> None:
    import cv2

    brightness = (_TEXT_BRIGHTNESS,) * 3
    origin = (left_px + 2, top_px + _LINE_PX - 8)
    cv2.putText(sheet, text, origin, cv2.FONT_HERSHEY_SIMPLEX, 0.45, brightness, 1, cv2.LINE_AA)
