"""Projection of Gaussians to the image (EWA splatting), and its gradients.

Forward: Zwicker et al. 2001, "EWA Volume Splatting", as used by Kerbl et al. 2023. A Gaussian with
covariance M M^T, M = R(q) diag(s), seen through the camera rotation W and the Jacobian J of the
perspective division at its centre, has the image covariance C = (J W M) (J W M)^T + blur.
With the rows a, b of J W M, C needs nothing but dot products, and its determinant

    det C = |a x b|^2 + blur (|a|^2 + |b|^2) + blur^2

is a sum of non-negative terms, which float32 evaluates without cancellation also for needles.

Every Gaussian becomes one record of 16 floats (one cache line), laid out below.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange

from animator.jit.kernel import RELAXED, kernel
from animator.render import splat_rules
from animator.types import Camera

RECORD_FLOATS = 16
X, Y = 0, 1  # centre [px]
XX, XY, YY = 2, 3, 4  # log2(alpha) = XX dx^2 + XY dx dy + YY dy^2 + PEAK
PEAK = 5  # log2(opacity)
RED, GREEN, BLUE = 6, 7, 8
HALF_WIDTH, HALF_HEIGHT = 9, 10  # of the region where alpha >= ALPHA_MIN [px]; < 0: hidden
LEVEL = 11  # that region is where the Mahalanobis distance squared is at most this
OPACITY = 12
DEPTH = 13  # along +z [scene unit]

_F = np.float32
_ZERO = _F(0)
_HALF = _F(0.5)
_ONE = _F(1)
_TWO = _F(2)
_255 = _F(255)
_BLUR = _F(splat_rules.BLUR_PX2)
_NEAR = _F(splat_rules.NEAR)
_ALPHA_MIN = _F(splat_rules.ALPHA_MIN)
_LOG2_E = _F(splat_rules.LOG2_E)
_LARGEST = _F(1e15)  # squares of what is larger might overflow


class GaussianArrays(NamedTuple):
    """The float32 arrays of N Gaussians, C-contiguous."""

    means: np.ndarray
    quats_wxyz: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray


class GaussianGradients(NamedTuple):
    """Where the gradients of `GaussianArrays` go; colors may have no rows if nobody needs them."""

    means: np.ndarray
    quats_wxyz: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray


class View(NamedTuple):
    """A camera in the form the kernels read."""

    cam_from_world: np.ndarray
    """float32, shape (3, 4)."""
    fx: np.float32
    fy: np.float32
    cx: np.float32
    cy: np.float32
    width: int
    height: int


def view_of(camera: Camera) -> View:
    """Return the camera for the kernels."""
    matrix = camera.intrinsics
    return View(
        cam_from_world=np.ascontiguousarray(camera.cam_from_world[:3], np.float32),
        fx=np.float32(matrix[0, 0]),
        fy=np.float32(matrix[1, 1]),
        cx=np.float32(matrix[0, 2]),
        cy=np.float32(matrix[1, 2]),
        width=int(camera.width_px),
        height=int(camera.height_px),
    )


@njit(fastmath=set(RELAXED), error_model="numpy")
def _camera_point(means, i, world):
    """Return the centre of Gaussian i in camera space."""
    x, y, z = means[i, 0], means[i, 1], means[i, 2]
    return (
        world[0, 0] * x + world[0, 1] * y + world[0, 2] * z + world[0, 3],
        world[1, 0] * x + world[1, 1] * y + world[1, 2] * z + world[1, 3],
        world[2, 0] * x + world[2, 1] * y + world[2, 2] * z + world[2, 3],
    )


@njit(fastmath=set(RELAXED), error_model="numpy")
def _unit_quat(quats, i):
    """Return the normalized quaternion of Gaussian i and one over its length."""
    w, x, y, z = quats[i, 0], quats[i, 1], quats[i, 2], quats[i, 3]
    inverse_norm = _ONE / math.sqrt(w * w + x * x + y * y + z * z)
    return w * inverse_norm, x * inverse_norm, y * inverse_norm, z * inverse_norm, inverse_norm


@njit(fastmath=set(RELAXED), error_model="numpy")
def _rotation(w, x, y, z):
    """Return the rotation matrix of a unit quaternion, by rows."""
    return (
        _ONE - _TWO * (y * y + z * z),
        _TWO * (x * y - w * z),
        _TWO * (x * z + w * y),
        _TWO * (x * y + w * z),
        _ONE - _TWO * (x * x + z * z),
        _TWO * (y * z - w * x),
        _TWO * (x * z - w * y),
        _TWO * (y * z + w * x),
        _ONE - _TWO * (x * x + y * y),
    )


@njit(fastmath=set(RELAXED), error_model="numpy")
def _clamped_slopes(slope_x, slope_y, view):
    """Return X/Z and Y/Z, moved to the frustum plus a margin, where linearizing is still sound."""
    margin = _F(splat_rules.FRUSTUM_MARGIN) * _HALF
    width, height = _F(view.width), _F(view.height)
    right = (width - view.cx + margin * width) / view.fx
    left = -(view.cx + margin * width) / view.fx
    bottom = (height - view.cy + margin * height) / view.fy
    top = -(view.cy + margin * height) / view.fy
    return min(max(slope_x, left), right), min(max(slope_y, top), bottom)


@njit(fastmath=set(RELAXED), error_model="numpy")
def _image_axes(slope_x, slope_y, inverse_z, view):
    """Return the rows u, v of J W, with J taken at the (clamped) slopes."""
    world = view.cam_from_world
    fx, fy = view.fx * inverse_z, view.fy * inverse_z
    return (
        fx * (world[0, 0] - slope_x * world[2, 0]),
        fx * (world[0, 1] - slope_x * world[2, 1]),
        fx * (world[0, 2] - slope_x * world[2, 2]),
        fy * (world[1, 0] - slope_y * world[2, 0]),
        fy * (world[1, 1] - slope_y * world[2, 1]),
        fy * (world[1, 2] - slope_y * world[2, 2]),
    )


@kernel(parallel=True, fastmath=RELAXED, depends_on=(splat_rules,))
def project(gaussians, view, records):
    """Fill one record a Gaussian; hidden ones get a negative half width.

    Hidden are Gaussians nearer than `NEAR`, fainter than `ALPHA_MIN`, beside the image, or broken:
    with a number that is not finite, a zero quaternion, or a size beyond float32.

    Args:
        gaussians: `GaussianArrays`.
        view: `View`.
        records: Output, float32, shape (N, RECORD_FLOATS).

    Returns:
        How many Gaussians are broken.
    """
    means, quats, scales, opacities, colors = gaussians
    world = view.cam_from_world
    width, height = _F(view.width), _F(view.height)
    broken = 0
    for i in prange(means.shape[0]):
        record = records[i]
        record[HALF_WIDTH] = -_ONE
        px, py, pz = _camera_point(means, i, world)
        record[DEPTH] = pz
        opacity = opacities[i]
        if not (abs(px) + abs(py) + abs(pz) < _LARGEST) or opacity != opacity:
            broken += 1
            continue
        if pz < _NEAR or opacity < _ALPHA_MIN:
            continue
        w, x, y, z, _inverse_norm = _unit_quat(quats, i)
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(w, x, y, z)
        inverse_z = _ONE / pz
        slope_x, slope_y = px * inverse_z, py * inverse_z
        near_x, near_y = _clamped_slopes(slope_x, slope_y, view)
        u0, u1, u2, v0, v1, v2 = _image_axes(near_x, near_y, inverse_z, view)
        s0, s1, s2 = scales[i, 0], scales[i, 1], scales[i, 2]
        a0 = (u0 * r00 + u1 * r10 + u2 * r20) * s0
        a1 = (u0 * r01 + u1 * r11 + u2 * r21) * s1
        a2 = (u0 * r02 + u1 * r12 + u2 * r22) * s2
        b0 = (v0 * r00 + v1 * r10 + v2 * r20) * s0
        b1 = (v0 * r01 + v1 * r11 + v2 * r21) * s1
        b2 = (v0 * r02 + v1 * r12 + v2 * r22) * s2
        aa = a0 * a0 + a1 * a1 + a2 * a2
        ab = a0 * b0 + a1 * b1 + a2 * b2
        bb = b0 * b0 + b1 * b1 + b2 * b2
        n0 = a1 * b2 - a2 * b1
        n1 = a2 * b0 - a0 * b2
        n2 = a0 * b1 - a1 * b0
        determinant = n0 * n0 + n1 * n1 + n2 * n2 + _BLUR * (aa + bb) + _BLUR * _BLUR
        tint = abs(colors[i, 0]) + abs(colors[i, 1]) + abs(colors[i, 2])
        if not (determinant < _LARGEST * _LARGEST and tint < _LARGEST and opacity < _LARGEST):
            broken += 1
            continue
        level = max(_ZERO, _TWO * math.log(_255 * opacity))
        half_width = math.sqrt(level * (aa + _BLUR))
        half_height = math.sqrt(level * (bb + _BLUR))
        center_x = view.fx * slope_x + view.cx
        center_y = view.fy * slope_y + view.cy
        if (
            center_x + half_width < _ZERO
            or center_x - half_width > width
            or center_y + half_height < _ZERO
            or center_y - half_height > height
        ):
            continue
        factor = _LOG2_E / determinant
        record[X] = center_x
        record[Y] = center_y
        record[XX] = -_HALF * factor * (bb + _BLUR)
        record[XY] = factor * ab
        record[YY] = -_HALF * factor * (aa + _BLUR)
        record[PEAK] = math.log(opacity) * _LOG2_E
        record[RED] = colors[i, 0]
        record[GREEN] = colors[i, 1]
        record[BLUE] = colors[i, 2]
        record[HALF_WIDTH] = half_width
        record[HALF_HEIGHT] = half_height
        record[LEVEL] = level
        record[OPACITY] = opacity
    return broken


@kernel(parallel=True, fastmath=RELAXED, depends_on=(splat_rules,))
def project_backward(gaussians, view, records, slots, spans, gradients):
    """Add up what the tiles found for each Gaussian and carry it back through the projection.

    Args:
        gaussians: `GaussianArrays`, as projected.
        view: `View`.
        records: What `project` filled.
        slots: A row for every pair of a tile and a Gaussian, as `blend_backward` fills it: the sums
            over pixels of g, g dx, g dy, g dx^2, g dx dy, g dy^2 with g = dLoss/d(-ln alpha), then
            three color gradients if `gradients.colors` has rows.
        spans: First row and number of rows of each Gaussian, shape (N, 2).
        gradients: Output, `GaussianGradients`.
    """
    means, quats, scales, opacities, _colors = gaussians
    grad_means, grad_quats, grad_scales, grad_opacities, grad_colors = gradients
    world = view.cam_from_world
    with_colors = grad_colors.shape[0] > 0
    for i in prange(means.shape[0]):
        record = records[i]
        is_visible = record[HALF_WIDTH] >= _ZERO
        first = spans[i, 0]
        last = first + spans[i, 1] if is_visible else first
        sum_1, sum_x, sum_y, sum_xx, sum_xy, sum_yy = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
        for slot in range(first, last):
            sum_1 += slots[slot, 0]
            sum_x += slots[slot, 1]
            sum_y += slots[slot, 2]
            sum_xx += slots[slot, 3]
            sum_xy += slots[slot, 4]
            sum_yy += slots[slot, 5]
        if with_colors:
            for c in range(3):
                total = _ZERO
                for slot in range(first, last):
                    total += slots[slot, 6 + c]
                grad_colors[i, c] = total
        grad_opacities[i] = -sum_1 / opacities[i] if is_visible else _ZERO
        if not is_visible:
            for c in range(3):
                grad_means[i, c] = _ZERO
                grad_scales[i, c] = _ZERO
            for c in range(4):
                grad_quats[i, c] = _ZERO
            continue

        # The inverse covariance [[ia, ib], [ib, ic]] and the gradients of its entries.
        ia = -_TWO / _LOG2_E * record[XX]
        ib = -_ONE / _LOG2_E * record[XY]
        ic = -_TWO / _LOG2_E * record[YY]
        grad_x = -(ia * sum_x + ib * sum_y)
        grad_y = -(ib * sum_x + ic * sum_y)
        # dLoss/dC = -C^-1 G C^-1 with G = [[sum_xx, sum_xy], [sum_xy, sum_yy]] / 2.
        m00 = _HALF * (ia * sum_xx + ib * sum_xy)
        m01 = _HALF * (ia * sum_xy + ib * sum_yy)
        m10 = _HALF * (ib * sum_xx + ic * sum_xy)
        m11 = _HALF * (ib * sum_xy + ic * sum_yy)
        h00 = -(m00 * ia + m01 * ib)
        h01 = -(m00 * ib + m01 * ic)
        h11 = -(m10 * ib + m11 * ic)

        px, py, pz = _camera_point(means, i, world)
        w, x, y, z, inverse_norm = _unit_quat(quats, i)
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(w, x, y, z)
        inverse_z = _ONE / pz
        slope_x, slope_y = px * inverse_z, py * inverse_z
        near_x, near_y = _clamped_slopes(slope_x, slope_y, view)
        u0, u1, u2, v0, v1, v2 = _image_axes(near_x, near_y, inverse_z, view)
        s0, s1, s2 = scales[i, 0], scales[i, 1], scales[i, 2]
        # Rows of J W R, before the scales.
        a0 = u0 * r00 + u1 * r10 + u2 * r20
        a1 = u0 * r01 + u1 * r11 + u2 * r21
        a2 = u0 * r02 + u1 * r12 + u2 * r22
        b0 = v0 * r00 + v1 * r10 + v2 * r20
        b1 = v0 * r01 + v1 * r11 + v2 * r21
        b2 = v0 * r02 + v1 * r12 + v2 * r22
        # C = P P^T with P = J W R diag(s), so dLoss/dP = 2 H P; da, db are its rows.
        da0 = _TWO * (h00 * a0 + h01 * b0) * s0
        da1 = _TWO * (h00 * a1 + h01 * b1) * s1
        da2 = _TWO * (h00 * a2 + h01 * b2) * s2
        db0 = _TWO * (h01 * a0 + h11 * b0) * s0
        db1 = _TWO * (h01 * a1 + h11 * b1) * s1
        db2 = _TWO * (h01 * a2 + h11 * b2) * s2
        grad_scales[i, 0] = da0 * a0 + db0 * b0
        grad_scales[i, 1] = da1 * a1 + db1 * b1
        grad_scales[i, 2] = da2 * a2 + db2 * b2
        da0 *= s0
        da1 *= s1
        da2 *= s2
        db0 *= s0
        db1 *= s1
        db2 *= s2

        # Through J W: rows du, dv; then through the Jacobian's entries.
        du0 = da0 * r00 + da1 * r01 + da2 * r02
        du1 = da0 * r10 + da1 * r11 + da2 * r12
        du2 = da0 * r20 + da1 * r21 + da2 * r22
        dv0 = db0 * r00 + db1 * r01 + db2 * r02
        dv1 = db0 * r10 + db1 * r11 + db2 * r12
        dv2 = db0 * r20 + db1 * r21 + db2 * r22
        fx, fy = view.fx * inverse_z, view.fy * inverse_z
        dj_xx = du0 * world[0, 0] + du1 * world[0, 1] + du2 * world[0, 2]
        dj_xz = du0 * world[2, 0] + du1 * world[2, 1] + du2 * world[2, 2]
        dj_yy = dv0 * world[1, 0] + dv1 * world[1, 1] + dv2 * world[1, 2]
        dj_yz = dv0 * world[2, 0] + dv1 * world[2, 1] + dv2 * world[2, 2]
        # J = [[fx/Z, 0, -fx/Z tx], [0, fy/Z, -fy/Z ty]], tx and ty the clamped slopes.
        grad_px = fx * grad_x
        grad_py = fy * grad_y
        grad_pz = -fx * slope_x * grad_x - fy * slope_y * grad_y
        grad_pz -= inverse_z * (fx * (dj_xx - near_x * dj_xz) + fy * (dj_yy - near_y * dj_yz))
        if near_x == slope_x:
            grad_px -= fx * inverse_z * dj_xz
            grad_pz += fx * inverse_z * slope_x * dj_xz
        if near_y == slope_y:
            grad_py -= fy * inverse_z * dj_yz
            grad_pz += fy * inverse_z * slope_y * dj_yz
        for c in range(3):
            grad_means[i, c] = world[0, c] * grad_px + world[1, c] * grad_py + world[2, c] * grad_pz

        # dLoss/dR = u^T da + v^T db, then from the matrix to the quaternion.
        g00, g01, g02 = u0 * da0 + v0 * db0, u0 * da1 + v0 * db1, u0 * da2 + v0 * db2
        g10, g11, g12 = u1 * da0 + v1 * db0, u1 * da1 + v1 * db1, u1 * da2 + v1 * db2
        g20, g21, g22 = u2 * da0 + v2 * db0, u2 * da1 + v2 * db1, u2 * da2 + v2 * db2
        gw = _TWO * (x * (g21 - g12) + y * (g02 - g20) + z * (g10 - g01))
        gx = _TWO * (-_TWO * x * (g11 + g22) + y * (g10 + g01) + z * (g20 + g02) + w * (g21 - g12))
        gy = _TWO * (x * (g10 + g01) - _TWO * y * (g00 + g22) + z * (g21 + g12) + w * (g02 - g20))
        gz = _TWO * (x * (g20 + g02) + y * (g21 + g12) - _TWO * z * (g00 + g11) + w * (g10 - g01))
        along = gw * w + gx * x + gy * y + gz * z
        grad_quats[i, 0] = (gw - along * w) * inverse_norm
        grad_quats[i, 1] = (gx - along * x) * inverse_norm
        grad_quats[i, 2] = (gy - along * y) * inverse_norm
        grad_quats[i, 3] = (gz - along * z) * inverse_norm
