"""Which Gaussians touch which tile of the image, front to back.

All visible Gaussians are sorted by depth once; a stable counting sort then deals them to the tiles,
so that no tile sorts anything. A Gaussian is dealt to exactly the tiles its ellipse alpha >=
ALPHA_MIN reaches, row of tiles by row of tiles (Radl et al. 2024, "StopThePop"; "AccuTile" in Feng
et al. 2024, "FlashGS").

A pair of a tile and a Gaussian has two numbers: its place in the tile's list (an entry), and its
slot. The slots of one Gaussian are consecutive, in a fixed order of tiles, so gradients are written
by tiles and added by Gaussians without locks, and in the same order for any number of threads.
"""

import math

import numpy as np
from numba import njit, prange

from animator.jit import simd
from animator.jit.kernel import STRICT, kernel
from animator.render import projection, splat_rules
from animator.render.projection import (
    DEPTH,
    HALF_HEIGHT,
    HALF_WIDTH,
    LEVEL,
    XX,
    XY,
    YY,
    X,
    Y,
)

TILE_WIDTH = simd.LANES
"""Columns of a tile [px]: one vector."""

TILE_HEIGHT = 16 if simd.LANES == 16 else 32
"""Rows of a tile [px]; narrow tiles are higher, which was fastest with 8 lanes."""

_F = np.float32
_ZERO = _F(0)
_HALF = _F(0.5)
_ONE = _F(1)
_COLUMN = _F(TILE_WIDTH)
_ROW = _F(TILE_HEIGHT)
_PER_COLUMN = _F(1 / TILE_WIDTH)
_PER_ROW = _F(1 / TILE_HEIGHT)
_RADIX_BITS = 11
_BUCKETS = 1 << _RADIX_BITS
_LOG2_E = _F(splat_rules.LOG2_E)


def tile_counts(width_px: int, height_px: int) -> tuple[int, int]:
    """Return the numbers of columns and rows of tiles that cover an image."""
    return -(-width_px // TILE_WIDTH), -(-height_px // TILE_HEIGHT)


@kernel(fastmath=STRICT, depends_on=(projection, splat_rules))
def sort_by_depth(records, keys, order):
    """Sort the visible Gaussians front to back, ties by index (radix sort of the float's bits).

    Args:
        records: Projected Gaussians, float32, shape (N, RECORD_FLOATS).
        keys: Scratch, uint32, shape (2, N).
        order: Scratch and output, int32, shape (2, N); the result is in row 1.

    Returns:
        The number V of visible Gaussians; they are `order[1, :V]`.
    """
    histogram = np.zeros((3, _BUCKETS), np.int32)
    bits = records.view(np.uint32)
    mask = np.uint32(_BUCKETS - 1)
    visible = 0
    for i in range(records.shape[0]):
        if records[i, HALF_WIDTH] < _ZERO:
            continue
        key = bits[i, DEPTH]  # depths are positive, whose bits sort as integers do
        keys[0, visible] = key
        order[0, visible] = i
        visible += 1
        histogram[0, key & mask] += 1
        histogram[1, (key >> np.uint32(_RADIX_BITS)) & mask] += 1
        histogram[2, key >> np.uint32(2 * _RADIX_BITS)] += 1
    for digit in range(3):
        start = 0
        for bucket in range(_BUCKETS):
            size = histogram[digit, bucket]
            histogram[digit, bucket] = start
            start += size
        shift = np.uint32(_RADIX_BITS * digit)
        source, target = digit % 2, 1 - digit % 2
        for rank in range(visible):
            key = keys[source, rank]
            bucket = (key >> shift) & mask
            place = histogram[digit, bucket]
            histogram[digit, bucket] = place + 1
            keys[target, place] = key
            order[target, place] = order[source, rank]
    return visible


@njit(fastmath=set(STRICT), error_model="numpy")
def _tile_index(position_px, tiles_per_px, count):
    """Return the tile that holds a position, limited to 0..count (as floats: no overflow)."""
    return int(min(max(position_px * tiles_per_px, _ZERO), _F(count)))


@njit(fastmath=set(STRICT), error_model="numpy")
def _row_reach(record, top, bottom):
    """Return how far left and right of its centre an ellipse reaches between two heights.

    Args:
        record: The Gaussian.
        top: Upper limit relative to the centre [px], within the ellipse.
        bottom: Lower limit, likewise.
    """
    scale = -_ONE / _LOG2_E
    xx, xy, yy = _F(2) * scale * record[XX], scale * record[XY], _F(2) * scale * record[YY]
    level = record[LEVEL]
    inverse_xx = _ONE / xx
    # xx dx^2 + 2 xy dx dy + yy dy^2 = level, solved for dx at both heights.
    root_top = math.sqrt(max(_ZERO, xy * xy * top * top - xx * (yy * top * top - level)))
    root_bottom = math.sqrt(
        max(_ZERO, xy * xy * bottom * bottom - xx * (yy * bottom * bottom - level))
    )
    left = min(-xy * top - root_top, -xy * bottom - root_bottom) * inverse_xx
    right = max(-xy * top + root_top, -xy * bottom + root_bottom) * inverse_xx
    # The outermost points of the ellipse, if they lie between the heights.
    half_width = record[HALF_WIDTH]
    height_of_rightmost = -xy / yy * half_width
    if top <= height_of_rightmost <= bottom:
        right = half_width
    if top <= -height_of_rightmost <= bottom:
        left = -half_width
    return left, right


@kernel(parallel=True, fastmath=STRICT, depends_on=(projection, simd, splat_rules))
def deal_to_tiles(records, order, grid, touched, tallies, spans, offsets, entries):
    """Deal the sorted Gaussians to the tiles.

    Args:
        records: Projected Gaussians.
        order: Visible Gaussians front to back, int32, shape (V,).
        grid: Numbers of tile columns and rows.
        touched: Scratch for the tiles of one Gaussian after the other, int32, shape (C, S): the
            Gaussians are dealt in C chunks of at most S pairs.
        tallies: Scratch, int32, shape (C, tiles + 1); the last column counts a chunk's pairs.
        spans: Output: first slot and number of slots of each Gaussian, int32, shape (N, 2).
        offsets: Output: where each tile's entries begin, int32, shape (tiles + 1,).
        entries: Output: Gaussian and slot of each entry, int32, shape (C S, 2).

    Returns:
        The pairs of the fullest chunk; nothing is dealt if that is more than S.
    """
    columns, rows = grid
    tile_count = columns * rows
    chunks, capacity = touched.shape
    visible = order.shape[0]
    for i in range(spans.shape[0]):
        spans[i, 1] = 0
    for chunk in prange(chunks):
        tally = tallies[chunk]
        tally[:] = 0
        used = 0
        for rank in range(visible * chunk // chunks, visible * (chunk + 1) // chunks):
            record = records[order[rank]]
            first = used
            center_x, center_y = record[X] - _HALF, record[Y] - _HALF
            half_width, half_height = record[HALF_WIDTH], record[HALF_HEIGHT]
            row_begin = _tile_index(center_y - half_height, _PER_ROW, rows)
            row_end = _tile_index(center_y + half_height + _ROW, _PER_ROW, rows)
            column_begin = _tile_index(center_x - half_width, _PER_COLUMN, columns)
            column_end = _tile_index(center_x + half_width + _COLUMN, _PER_COLUMN, columns)
            is_simple = row_end - row_begin <= 1 or column_end - column_begin <= 1
            for row in range(row_begin, row_end):
                begin, end = column_begin, column_end
                if not is_simple:
                    top = max(_F(row * TILE_HEIGHT) - center_y, -half_height)
                    bottom = min(_F(row * TILE_HEIGHT + TILE_HEIGHT - 1) - center_y, half_height)
                    if top > bottom:
                        continue
                    left, right = _row_reach(record, top, bottom)
                    begin = max(begin, _tile_index(center_x + left, _PER_COLUMN, columns))
                    end = min(end, _tile_index(center_x + right + _COLUMN, _PER_COLUMN, columns))
                for tile in range(row * columns + begin, row * columns + end):
                    if used < capacity:
                        touched[chunk, used] = tile
                        tally[tile] += 1
                    used += 1
            spans[order[rank], 1] = used - first
        tally[tile_count] = used

    fullest = 0
    for chunk in range(chunks):
        fullest = max(fullest, tallies[chunk, tile_count])
    if fullest > capacity:
        return fullest

    # Slots follow the order of the Gaussians in memory, where their gradients are added up.
    start = 0
    for i in range(spans.shape[0]):
        spans[i, 0] = start
        start += spans[i, 1]
    start = 0
    for tile in range(tile_count):
        offsets[tile] = start
        for chunk in range(chunks):
            size = tallies[chunk, tile]
            tallies[chunk, tile] = start
            start += size
    offsets[tile_count] = start
    for chunk in prange(chunks):
        places = tallies[chunk]
        used = 0
        for rank in range(visible * chunk // chunks, visible * (chunk + 1) // chunks):
            i = order[rank]
            for slot in range(spans[i, 0], spans[i, 0] + spans[i, 1]):
                tile = touched[chunk, used]
                used += 1
                place = places[tile]
                places[tile] = place + 1
                entries[place, 0] = i
                entries[place, 1] = slot
    return fullest
