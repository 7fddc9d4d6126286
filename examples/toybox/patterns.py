"""Paint: functions from a place on a surface [scene unit] to a color."""

import numpy as np

from toybox.surfaces import Pattern

Color = tuple[float, float, float]
"""sRGB, 0..1."""

_LETTERS = {
    "A": (".###.", "#...#", "#...#", "#####", "#...#", "#...#", "#...#"),
    "L": ("#....", "#....", "#....", "#....", "#....", "#....", "#####"),
    "P": ("####.", "#...#", "#...#", "####.", "#....", "#....", "#...."),
    "S": (".####", "#....", "#....", ".###.", "....#", "....#", "####."),
    "T": ("#####", "..#..", "..#..", "..#..", "..#..", "..#..", "..#.."),
}
_LETTER_COLUMNS, _LETTER_ROWS = 5, 7


def color_from_hex(text: str) -> Color:
    """Return the color of `#rrggbb`."""
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red / 255, green / 255, blue / 255


def plain(color: Color) -> Pattern:
    """One color."""
    return lambda surface_xy: np.tile(color, (len(surface_xy), 1))


def checker(first: Color, second: Color, *, width: float, height: float) -> Pattern:
    """A chessboard of the given cells."""

    def paint(surface_xy: np.ndarray) -> np.ndarray:
        cells = np.floor(surface_xy / (width, height)).sum(axis=1)
        return _choose(cells % 2 == 0, first, second)

    return paint


def stripes(first: Color, second: Color, *, width: float, angle_rad: float) -> Pattern:
    """Bands of two colors that follow each other in the direction of the angle."""
    direction = np.array([np.cos(angle_rad), np.sin(angle_rad)])

    def paint(surface_xy: np.ndarray) -> np.ndarray:
        return _choose(np.floor(surface_xy @ direction / width) % 2 == 0, first, second)

    return paint


def dots(ground: Color, colors: tuple[Color, ...], *, spacing: float, radius: float) -> Pattern:
    """Dots on a square grid, one color after the other along the rows."""
    palette = np.array(colors)

    def paint(surface_xy: np.ndarray) -> np.ndarray:
        cells = np.floor(surface_xy / spacing + 0.5).astype(int)
        is_dot = np.linalg.norm(surface_xy - cells * spacing, axis=1) < radius
        dot_colors = palette[(cells[:, 0] + 2 * cells[:, 1]) % len(palette)]
        return np.where(is_dot[:, None], dot_colors, ground)

    return paint


def sectors(first: Color, second: Color, *, count: int, hub: Color, hub_radius: float) -> Pattern:
    """Slices of a disk about a hub."""

    def paint(surface_xy: np.ndarray) -> np.ndarray:
        turns = np.arctan2(surface_xy[:, 1], surface_xy[:, 0]) / (2 * np.pi)
        slices = _choose(np.floor(turns * count) % 2 == 0, first, second)
        is_hub = np.linalg.norm(surface_xy, axis=1) < hub_radius
        return np.where(is_hub[:, None], hub, slices)

    return paint


def letters(text: str, ink: Color, ground: Color, *, width: float, height: float) -> Pattern:
    """A word read from top to bottom, centered, one upright letter below the other."""
    rows = [row for letter in text for row in (*_LETTERS[letter], "." * _LETTER_COLUMNS)]
    bitmap = np.array([[character == "#" for character in row] for row in rows[:-1]])
    column_width, row_height = width / _LETTER_COLUMNS, height / _LETTER_ROWS

    def paint(surface_xy: np.ndarray) -> np.ndarray:
        columns = np.floor(surface_xy[:, 0] / column_width + _LETTER_COLUMNS / 2).astype(int)
        lines = np.floor(len(bitmap) / 2 - surface_xy[:, 1] / row_height).astype(int)
        is_inside = (columns >= 0) & (columns < _LETTER_COLUMNS)
        is_inside &= (lines >= 0) & (lines < len(bitmap))
        is_ink = is_inside.copy()
        is_ink[is_inside] = bitmap[lines[is_inside], columns[is_inside]]
        return _choose(is_ink, ink, ground)

    return paint


def _choose(is_first: np.ndarray, first: Color, second: Color) -> np.ndarray:
    return np.where(is_first[:, None], first, second)
