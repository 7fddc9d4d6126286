"""Front-to-back blending of the tiles, its gradients, and what each Gaussian contributes.

One vector holds one row of a tile. Per Gaussian and row, in log2 throughout:

    alpha = min(ALPHA_MAX, 2^(PEAK + XX dx^2 + XY dx dy + YY dy^2)),   skipped below ALPHA_MIN
    w = alpha T,   color += w c,   T -= w,   stopping before T <= TRANSMITTANCE_MIN

A finished pixel keeps its transmittance aside and goes on with T = 0, so that nothing can be added
to it and no separate mask is needed; the same holds for lanes beyond the edge of the image.

Backward runs front to back as well. With q_i = c_i . dL/dcolor, and S_i the sum of w_j q_j over all
Gaussians behind i minus T_final dL/dalpha_image,

    dL/dalpha_i = T_i q_i - S_i / (1 - alpha_i)

where S starts from the finished image and loses w_i q_i at each Gaussian.
"""

import math

import numpy as np
from numba import njit, prange

from animator.jit import simd
from animator.jit.kernel import STRICT, kernel
from animator.jit.simd import (
    LANES,
    any_lane,
    exp2,
    horizontal_sum,
    lane_indices,
    load,
    load_rgb,
    reciprocal,
    select,
    splat,
    store,
    store_rgb,
    store_sums,
)
from animator.render import projection, splat_rules, tiles
from animator.render.projection import (
    BLUE,
    GREEN,
    HALF_HEIGHT,
    PEAK,
    RED,
    XX,
    XY,
    YY,
    X,
    Y,
)
from animator.render.tiles import TILE_HEIGHT, TILE_WIDTH

SLOT_FLOATS = 8
"""Floats in a slot without color gradients: six sums and padding."""

COLOR_SLOT_FLOATS = 12
"""Floats in a slot with color gradients: nine sums and padding."""

_F = np.float32
_ZERO = _F(0)
_HALF = _F(0.5)
_ONE = _F(1)
_ALPHA_MAX = _F(splat_rules.ALPHA_MAX)
_LOG2_ALPHA_MIN = _F(splat_rules.LOG2_ALPHA_MIN)
_T_MIN = _F(splat_rules.TRANSMITTANCE_MIN)
_MODULES = (simd, splat_rules, projection, tiles)


@njit(fastmath=set(STRICT), error_model="numpy")
def _tile_window(tile, columns, width, height):
    """Return the left and top pixel of a tile, and its columns and rows inside the image."""
    left, top = tile % columns * TILE_WIDTH, tile // columns * TILE_HEIGHT
    return left, top, min(TILE_WIDTH, width - left), min(TILE_HEIGHT, height - top)


@njit(fastmath=set(STRICT), error_model="numpy")
def _row_range(record, top, rows):
    """Return the rows of a tile that an ellipse reaches, half open."""
    center = record[Y] - _F(top) - _HALF
    first = min(max(math.ceil(center - record[HALF_HEIGHT]), _ZERO), _F(rows))
    last = min(max(math.floor(center + record[HALF_HEIGHT]), -_ONE), _F(rows - 1))
    return int(first), int(last) + 1


@kernel(parallel=True, fastmath=STRICT, depends_on=_MODULES)
def blend(records, lists, image, lasts):
    """Draw all tiles.

    Args:
        records: Projected Gaussians.
        lists: Offsets and entries of the tiles, as dealt.
        image: Output: colors (H, W, 3) without background, and coverage (H, W), float32.
        lasts: Output: end of the entries each tile needed before all its pixels were finished.
    """
    offsets, entries = lists
    colors, coverage = image
    height, width = coverage.shape
    columns = (width + TILE_WIDTH - 1) // TILE_WIDTH
    colors_address = np.int64(colors.ctypes.data)
    coverage_address = np.int64(coverage.ctypes.data)
    for tile in prange(lasts.shape[0]):
        left, top, inside, rows = _tile_window(tile, columns, width, height)
        state = np.empty((TILE_HEIGHT, 5, LANES), np.float32)  # T, red, green, blue, final T
        base = np.int64(state.ctypes.data)
        lanes = lane_indices()
        zero, one = splat(_ZERO), splat(_ONE)
        alpha_max = splat(_ALPHA_MAX)
        start_t = select(lanes < _F(inside), one, zero)
        for row in range(rows):
            store(base, row * 5 * LANES, start_t)
            for plane in range(1, 5):
                store(base, (row * 5 + plane) * LANES, zero)
        live = (1 << rows) - 1  # one bit a row that has unfinished pixels
        entry, end = offsets[tile], offsets[tile + 1]
        while entry < end and live != 0:
            record = records[entries[entry, 0]]
            red, green, blue = record[RED], record[GREEN], record[BLUE]
            first, last = _row_range(record, top, rows)
            dx = lanes + (_F(left) + _HALF - record[X])
            constant = dx * dx * record[XX] + record[PEAK]
            linear = dx * record[XY]
            quadratic = splat(record[YY])
            dy = splat(_F(top + first) + _HALF - record[Y])
            for row in range(first, last):
                if (live >> row) & 1:
                    exponent = (quadratic * dy + linear) * dy + constant
                    alpha = exp2(exponent)
                    alpha = select(alpha < alpha_max, alpha, alpha_max)
                    place = row * 5 * LANES
                    t = load(base, place)
                    w = select(exponent >= _LOG2_ALPHA_MIN, alpha * t, zero)
                    after = t - w
                    finished = (after <= _T_MIN) & (t > _T_MIN)
                    if any_lane(finished):
                        aside = load(base, place + 4 * LANES)
                        store(base, place + 4 * LANES, select(finished, t, aside))
                        w = select(finished, zero, w)
                        after = select(finished, zero, after)
                        if not any_lane(after > _T_MIN):
                            live &= ~(1 << row)
                    store(base, place, after)
                    store(base, place + LANES, load(base, place + LANES) + w * red)
                    store(base, place + 2 * LANES, load(base, place + 2 * LANES) + w * green)
                    store(base, place + 3 * LANES, load(base, place + 3 * LANES) + w * blue)
                dy = dy + _ONE
            entry += 1
        lasts[tile] = entry
        if inside == LANES:
            for row in range(rows):
                place = row * 5 * LANES
                pixel = np.int64((top + row) * width + left)
                final = load(base, place) + load(base, place + 4 * LANES)
                store(coverage_address, pixel, one - final)
                store_rgb(
                    colors_address,
                    3 * pixel,
                    load(base, place + LANES),
                    load(base, place + 2 * LANES),
                    load(base, place + 3 * LANES),
                )
        else:
            for row in range(rows):
                for lane in range(inside):
                    final = state[row, 0, lane] + state[row, 4, lane]
                    coverage[top + row, left + lane] = _ONE - final
                    for channel in range(3):
                        colors[top + row, left + lane, channel] = state[row, 1 + channel, lane]


def _make_blend_backward(with_colors: bool, slot_floats: int):
    """Build the backward kernel with or without color gradients (a compile-time choice)."""

    @kernel(parallel=True, fastmath=STRICT, depends_on=_MODULES)
    def blend_backward(records, lists, image, image_gradients, lasts, slots):
        offsets, entries = lists
        colors, coverage = image
        grad_colors, grad_coverage = image_gradients
        height, width = coverage.shape
        columns = (width + TILE_WIDTH - 1) // TILE_WIDTH
        colors_address = np.int64(colors.ctypes.data)
        coverage_address = np.int64(coverage.ctypes.data)
        grad_colors_address = np.int64(grad_colors.ctypes.data)
        grad_coverage_address = np.int64(grad_coverage.ctypes.data)
        slots_address = np.int64(slots.ctypes.data)
        for tile in prange(lasts.shape[0]):
            left, top, inside, rows = _tile_window(tile, columns, width, height)
            state = np.empty((TILE_HEIGHT, 5, LANES), np.float32)  # T, S, then dL/dcolor
            base = np.int64(state.ctypes.data)
            lanes = lane_indices()
            zero, one = splat(_ZERO), splat(_ONE)
            alpha_max = splat(_ALPHA_MAX)
            start_t = select(lanes < _F(inside), one, zero)
            for row in range(rows):
                place = row * 5 * LANES
                store(base, place, start_t)
                if inside == LANES:
                    pixel = np.int64((top + row) * width + left)
                    red, green, blue = load_rgb(colors_address, 3 * pixel)
                    g_red, g_green, g_blue = load_rgb(grad_colors_address, 3 * pixel)
                    final = one - load(coverage_address, pixel)
                    behind = red * g_red + green * g_green + blue * g_blue
                    behind = behind - final * load(grad_coverage_address, pixel)
                    store(base, place + LANES, behind)
                    store(base, place + 2 * LANES, g_red)
                    store(base, place + 3 * LANES, g_green)
                    store(base, place + 4 * LANES, g_blue)
                else:
                    for plane in range(1, 5):
                        store(base, place + plane * LANES, zero)
                    for lane in range(inside):
                        y, x = top + row, left + lane
                        behind_pixel = (coverage[y, x] - _ONE) * grad_coverage[y, x]
                        for channel in range(3):
                            grad = grad_colors[y, x, channel]
                            behind_pixel += colors[y, x, channel] * grad
                            state[row, 2 + channel, lane] = grad
                        state[row, 1, lane] = behind_pixel
            live = (1 << rows) - 1
            entry, end = offsets[tile], lasts[tile]
            while entry < end and live != 0:
                record = records[entries[entry, 0]]
                slot = np.int64(entries[entry, 1]) * slot_floats
                red, green, blue = record[RED], record[GREEN], record[BLUE]
                first, last = _row_range(record, top, rows)
                dx = lanes + (_F(left) + _HALF - record[X])
                constant = dx * dx * record[XX] + record[PEAK]
                linear = dx * record[XY]
                quadratic = splat(record[YY])
                dy = splat(_F(top + first) + _HALF - record[Y])
                sum_1, sum_y, sum_yy = zero, zero, zero
                sum_red, sum_green, sum_blue = zero, zero, zero
                for row in range(first, last):
                    if (live >> row) & 1:
                        exponent = (quadratic * dy + linear) * dy + constant
                        alpha = exp2(exponent)
                        place = row * 5 * LANES
                        t = load(base, place)
                        drawn = (exponent >= _LOG2_ALPHA_MIN) & (t > _T_MIN)
                        differentiable = drawn & (alpha < alpha_max)
                        alpha = select(alpha < alpha_max, alpha, alpha_max)
                        w = select(drawn, alpha * t, zero)
                        after = t - w
                        finished = drawn & (after <= _T_MIN)
                        if any_lane(finished):
                            differentiable = differentiable & ~finished
                            w = select(finished, zero, w)
                            after = select(finished, zero, after)
                            if not any_lane(after > _T_MIN):
                                live &= ~(1 << row)
                        store(base, place, after)
                        g_red = load(base, place + 2 * LANES)
                        g_green = load(base, place + 3 * LANES)
                        g_blue = load(base, place + 4 * LANES)
                        gain = w * (g_red * red + g_green * green + g_blue * blue)
                        behind = load(base, place + LANES) - gain
                        store(base, place + LANES, behind)
                        odds = alpha * reciprocal(one - alpha)
                        g = select(differentiable, odds * behind - gain, zero)
                        g_y = g * dy
                        sum_1 = sum_1 + g
                        sum_y = sum_y + g_y
                        sum_yy = sum_yy + g_y * dy
                        if with_colors:
                            sum_red = sum_red + w * g_red
                            sum_green = sum_green + w * g_green
                            sum_blue = sum_blue + w * g_blue
                    dy = dy + _ONE
                sum_x = sum_1 * dx
                store_sums(
                    slots_address,
                    slot,
                    sum_1,
                    sum_x,
                    sum_y,
                    sum_x * dx,
                    sum_y * dx,
                    sum_yy,
                    sum_red,
                    sum_green,
                )
                if with_colors:
                    slots[entries[entry, 1], 8] = horizontal_sum(sum_blue)
                entry += 1
            for unused in range(entry, offsets[tile + 1]):
                for place in range(slot_floats):
                    slots[entries[unused, 1], place] = _ZERO

    return blend_backward


blend_backward = _make_blend_backward(False, SLOT_FLOATS)
"""Fill the slots that `projection.project_backward` adds up, without color gradients.

Arguments: records, lists and lasts as in `blend`, its image (colors and coverage), the gradients of
the loss by the image (same shapes), and the slots, float32, shape (slots, SLOT_FLOATS).
"""

blend_backward_colors = _make_blend_backward(True, COLOR_SLOT_FLOATS)
"""The same with color gradients; slots have shape (slots, COLOR_SLOT_FLOATS)."""


@kernel(parallel=True, fastmath=STRICT, depends_on=_MODULES)
def measure_contributions(records, lists, size, slots):
    """Fill the first two floats of every slot: the sums of alpha T, and of alpha, over the tile.

    Unlike `blend`, this goes on behind finished pixels, because the sum of alpha is what a Gaussian
    would contribute if nothing were in front.

    Args:
        records: Projected Gaussians.
        lists: Offsets and entries of the tiles.
        size: Image width and height [px].
        slots: Output, float32, shape (slots, SLOT_FLOATS).
    """
    offsets, entries = lists
    width, height = size
    columns = (width + TILE_WIDTH - 1) // TILE_WIDTH
    for tile in prange(offsets.shape[0] - 1):
        left, top, inside, rows = _tile_window(tile, columns, width, height)
        state = np.empty((TILE_HEIGHT, LANES), np.float32)
        base = np.int64(state.ctypes.data)
        lanes = lane_indices()
        zero, one = splat(_ZERO), splat(_ONE)
        alpha_max = splat(_ALPHA_MAX)
        in_image = lanes < _F(inside)
        for row in range(rows):
            store(base, row * LANES, select(in_image, one, zero))
        for entry in range(offsets[tile], offsets[tile + 1]):
            record = records[entries[entry, 0]]
            first, last = _row_range(record, top, rows)
            dx = lanes + (_F(left) + _HALF - record[X])
            constant = dx * dx * record[XX] + record[PEAK]
            linear = dx * record[XY]
            quadratic = splat(record[YY])
            dy = splat(_F(top + first) + _HALF - record[Y])
            seen, alone = zero, zero
            for row in range(first, last):
                exponent = (quadratic * dy + linear) * dy + constant
                alpha = exp2(exponent)
                alpha = select(alpha < alpha_max, alpha, alpha_max)
                alpha = select((exponent >= _LOG2_ALPHA_MIN) & in_image, alpha, zero)
                t = load(base, row * LANES)
                w = alpha * t
                w = select(t - w <= _T_MIN, zero, w)
                after = t - w
                finished = (alpha > _ZERO) & (t - alpha * t <= _T_MIN)
                store(base, row * LANES, select(finished, zero, after))
                seen = seen + w
                alone = alone + alpha
                dy = dy + _ONE
            slots[entries[entry, 1], 0] = horizontal_sum(seen)
            slots[entries[entry, 1], 1] = horizontal_sum(alone)


@kernel(parallel=True, fastmath=STRICT, depends_on=_MODULES)
def add_contributions(records, spans, slots, contributions):
    """Add up the slots of `measure_contributions`: a row (alpha T, alpha) for every Gaussian."""
    for i in prange(records.shape[0]):
        contributions[i, 0] = _ZERO
        contributions[i, 1] = _ZERO
        if records[i, projection.HALF_WIDTH] >= _ZERO:
            for slot in range(spans[i, 0], spans[i, 0] + spans[i, 1]):
                contributions[i, 0] += slots[slot, 0]
                contributions[i, 1] += slots[slot, 1]
