"""Explicit SIMD values inside numba kernels: a vector of floats and a mask of lanes.

LLVM does not vectorise the blending loops by itself. These two types map straight to LLVM's
vector types, so a kernel written with them compiles to the same instructions as C++ with vector
extensions. `LANES` is 16 where the CPU has AVX-512 and 8 elsewhere; where registers are narrower
(SSE, NEON) LLVM splits a vector over several of them.

A kernel combines vectors with `+ - * /`, compares them into masks with `< <= > >=`, combines
masks with `& | ~`, and may mix vectors with float32 scalars. Addresses are `array.ctypes.data`
as int64, offsets count floats; nothing is bounds-checked.
"""

import operator
import os
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from animator.jit.kernel import LANES_VARIABLE

_FLAGS = ("nsz", "contract")
_I32 = ir.IntType(32)
_I64 = ir.IntType(64)


def _host_features() -> dict[str, bool]:
    try:
        return dict(binding.get_host_cpu_features())
    except RuntimeError:  # LLVM cannot name the features of every CPU
        return {}


def _choose_lanes(features: dict[str, bool]) -> int:
    wanted = os.environ.get(LANES_VARIABLE, "")
    if not wanted:
        return 16 if features.get("avx512f") else 8
    if wanted not in {"8", "16"}:
        raise ValueError(f"{LANES_VARIABLE}: expected 8 or 16, found {wanted!r}; unset it")
    return int(wanted)


_FEATURES = _host_features()

LANES = _choose_lanes(_FEATURES)
"""Floats in one vector."""

_FLOATS = ir.VectorType(ir.FloatType(), LANES)
_INTS = ir.VectorType(_I32, LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)


class VectorType(types.Type):
    """The numba type of `LANES` floats."""

    def __init__(self):
        super().__init__(name=f"Vector{LANES}")


class MaskType(types.Type):
    """The numba type of `LANES` booleans."""

    def __init__(self):
        super().__init__(name=f"Mask{LANES}")


VECTOR = VectorType()
MASK = MaskType()


@register_model(VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager, numba_type):
        super().__init__(manager, numba_type, _FLOATS)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, numba_type):
        super().__init__(manager, numba_type, _BITS)


def _constant(value):
    """Return the IR constant with `value`, rounded to float32, in every lane."""
    return ir.Constant(_FLOATS, [float(np.float32(value))] * LANES)


def _broadcast(builder, scalar):
    undefined = ir.Constant(_FLOATS, ir.Undefined)
    first = builder.insert_element(undefined, scalar, ir.Constant(_I32, 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(_INTS, [0] * LANES))


def _as_vector(builder, numba_type, value):
    return _broadcast(builder, value) if numba_type == types.float32 else value


def _shuffle(builder, left, right, picks):
    indices = ir.Constant(ir.VectorType(_I32, len(picks)), list(picks))
    return builder.shuffle_vector(left, right, indices)


def _pointer(builder, address, offset, pointee):
    byte_offset = builder.mul(offset, ir.Constant(_I64, 4))
    return builder.inttoptr(builder.add(address, byte_offset), pointee.as_pointer())


def _load(builder, address, offset, kind=_FLOATS):
    value = builder.load(_pointer(builder, address, offset, kind))
    value.align = 4
    return value


def _store(builder, value, address, offset):
    instruction = builder.store(value, _pointer(builder, address, offset, value.type))
    instruction.align = 4


# --- operators -----------------------------------------------------------------------------------


def _is_vector_pair(left, right):
    """Tell whether the operands are two vectors, or a vector and a float32."""
    return VECTOR in (left, right) and {left, right} <= {VECTOR, types.float32}


def _define_arithmetic(python_operator, instruction):
    @type_callable(python_operator)
    def type_arithmetic(_context):
        return lambda left, right: VECTOR if _is_vector_pair(left, right) else None

    def lower(_context, builder, signature, arguments):
        left, right = map(lambda t, v: _as_vector(builder, t, v), signature.args, arguments)
        return getattr(builder, instruction)(left, right, flags=_FLAGS)

    for operands in ((VectorType,) * 2, (VectorType, types.Float), (types.Float, VectorType)):
        lower_builtin(python_operator, *operands)(lower)


def _define_comparison(python_operator, symbol):
    @type_callable(python_operator)
    def type_comparison(_context):
        return lambda left, right: MASK if _is_vector_pair(left, right) else None

    def lower(_context, builder, signature, arguments):
        left, right = map(lambda t, v: _as_vector(builder, t, v), signature.args, arguments)
        return builder.fcmp_ordered(symbol, left, right)

    for operands in ((VectorType,) * 2, (VectorType, types.Float), (types.Float, VectorType)):
        lower_builtin(python_operator, *operands)(lower)


def _define_mask_operator(python_operator, instruction):
    @type_callable(python_operator)
    def type_mask_operator(_context):
        return lambda left, right: MASK if left is MASK and right is MASK else None

    @lower_builtin(python_operator, MaskType, MaskType)
    def lower(_context, builder, _signature, arguments):
        return getattr(builder, instruction)(*arguments)


for _operators, _instruction in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
    ((operator.truediv, operator.itruediv), "fdiv"),
):
    for _operator in _operators:
        _define_arithmetic(_operator, _instruction)

for _operator, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
):
    _define_comparison(_operator, _symbol)

for _operators, _instruction in (
    ((operator.and_, operator.iand), "and_"),
    ((operator.or_, operator.ior), "or_"),
):
    for _operator in _operators:
        _define_mask_operator(_operator, _instruction)


@type_callable(operator.invert)
def _type_invert(_context):
    return lambda mask: MASK if mask is MASK else None


@lower_builtin(operator.invert, MaskType)
def _lower_invert(_context, builder, _signature, arguments):
    return builder.not_(arguments[0])


def _operation(generator: Callable[..., Any]) -> Any:
    """Make an operation that kernels call without the generator's first argument, the typing."""
    return intrinsic(generator)


# --- lanes and memory ----------------------------------------------------------------------------


@_operation
def splat(_typing, scalar):
    """Return a vector with one float32 in every lane."""

    def generate(_context, builder, _signature, arguments):
        return _broadcast(builder, arguments[0])

    return VECTOR(types.float32), generate


@_operation
def lane_indices(_typing):
    """Return the vector 0, 1, 2, ..."""

    def generate(_context, _builder, _signature, _arguments):
        return ir.Constant(_FLOATS, [float(lane) for lane in range(LANES)])

    return VECTOR(), generate


@_operation
def load(_typing, address, offset):
    """Read the vector at `address` plus `offset` floats."""

    def generate(_context, builder, _signature, arguments):
        return _load(builder, *arguments)

    return VECTOR(types.int64, types.int64), generate


@_operation
def store(_typing, address, offset, vector):
    """Write the vector at `address` plus `offset` floats."""

    def generate(context, builder, _signature, arguments):
        _store(builder, arguments[2], arguments[0], arguments[1])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, VECTOR), generate


@_operation
def load_rgb(_typing, address, offset):
    """Read `3 * LANES` interleaved floats as three vectors: reds, greens, blues."""

    def generate(context, builder, signature, arguments):
        address, offset = arguments
        parts = [
            _load(builder, address, builder.add(offset, ir.Constant(_I64, part * LANES)))
            for part in range(3)
        ]
        planes = []
        for channel in range(3):
            # Lane i sits at float 3 i + channel: gather from the first two parts, then the third.
            places = [3 * lane + channel for lane in range(LANES)]
            early = [place if place < 2 * LANES else 0 for place in places]
            late = [
                lane if place < 2 * LANES else place - LANES for lane, place in enumerate(places)
            ]
            plane = _shuffle(builder, parts[0], parts[1], early)
            planes.append(_shuffle(builder, plane, parts[2], late))
        return context.make_tuple(builder, signature.return_type, planes)

    return types.UniTuple(VECTOR, 3)(types.int64, types.int64), generate


@_operation
def store_rgb(_typing, address, offset, red, green, blue):
    """Write three vectors as `3 * LANES` interleaved floats."""

    def generate(context, builder, _signature, arguments):
        address, offset, red, green, blue = arguments
        for part in range(3):
            places = [divmod(part * LANES + lane, 3) for lane in range(LANES)]
            first = [pixel + (LANES if channel == 1 else 0) for pixel, channel in places]
            both = _shuffle(builder, red, green, first)
            second = [
                LANES + pixel if channel == 2 else lane
                for lane, (pixel, channel) in enumerate(places)
            ]
            mixed = _shuffle(builder, both, blue, second)
            _store(builder, mixed, address, builder.add(offset, ir.Constant(_I64, part * LANES)))
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, VECTOR, VECTOR, VECTOR), generate


# --- selection and reduction ---------------------------------------------------------------------


@_operation
def select(_typing, mask, where_true, where_false):
    """Pick `where_true` in the lanes of the mask and `where_false` elsewhere."""

    def generate(_context, builder, _signature, arguments):
        return builder.select(*arguments)

    return VECTOR(MASK, VECTOR, VECTOR), generate


@_operation
def any_lane(_typing, mask):
    """Tell whether the mask is set in any lane."""

    def generate(_context, builder, _signature, arguments):
        bits = builder.bitcast(arguments[0], ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(LANES), 0))

    return types.boolean(MASK), generate


@_operation
def horizontal_sum(_typing, vector):
    """Add up the lanes, in the order LLVM's reduction tree chooses for the target."""

    def generate(_context, builder, _signature, arguments):
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.FloatType(), [ir.FloatType(), _FLOATS]),
            f"llvm.vector.reduce.fadd.v{LANES}f32",
        )
        start = ir.Constant(ir.FloatType(), -0.0)
        return builder.call(function, [start, arguments[0]], fastmath=("reassoc", "nsz"))

    return types.float32(VECTOR), generate


@_operation
def store_sums(_typing, address, offset, v0, v1, v2, v3, v4, v5, v6, v7):
    """Write the lane sums of eight vectors as eight consecutive floats.

    A transposing tree of additions: each level adds the halves of every vector and packs two
    vectors into one, so eight sums cost hardly more than one. The order of additions is fixed.
    """

    def generate(context, builder, _signature, arguments):
        address, offset, *vectors = arguments
        packed = 1  # sums that share one vector
        while len(vectors) > 1:
            half = LANES // packed // 2
            low = [
                side + segment * 2 * half + lane
                for side in (0, LANES)
                for segment in range(packed)
                for lane in range(half)
            ]
            high = [place + half for place in low]
            vectors = [
                builder.fadd(
                    _shuffle(builder, left, right, low), _shuffle(builder, left, right, high)
                )
                for left, right in zip(vectors[0::2], vectors[1::2], strict=True)
            ]
            packed *= 2
        sums = vectors[0]
        width = LANES // 8
        while width > 1:
            half = width // 2
            undefined = ir.Constant(sums.type, ir.Undefined)
            low = [segment * width + lane for segment in range(8) for lane in range(half)]
            high = [place + half for place in low]
            sums = builder.fadd(
                _shuffle(builder, sums, undefined, low), _shuffle(builder, sums, undefined, high)
            )
            width = half
        _store(builder, sums, address, offset)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, *[VECTOR] * 8), generate


# --- functions -----------------------------------------------------------------------------------

_EXP2_COEFFICIENTS = (
    1.330384381e-3,
    9.673502912e-3,
    5.550685383e-2,
    2.402218904e-1,
    6.931469133e-1,
    1.000000044,
)
"""Polynomial of 2**f on [-0.5, 0.5], highest power first: least maximal relative error, 1.2e-7."""

_ROUNDING = 12582912.0
"""1.5 * 2**23: adding it rounds a float32 to an integer, left in the low bits of the mantissa."""


@_operation
def exp2(_typing, exponent):
    """Return 2**exponent, relative error below 4e-7, for exponents in [-126, 127].

    Outside that range the result is meaningless (not an error): mask it.
    """

    def generate(_context, builder, _signature, arguments):
        (exponent,) = arguments
        rounded = builder.fadd(exponent, _constant(_ROUNDING))
        fraction = builder.fsub(exponent, builder.fsub(rounded, _constant(_ROUNDING)))
        value = _constant(_EXP2_COEFFICIENTS[0])
        for coefficient in _EXP2_COEFFICIENTS[1:]:
            product = builder.fmul(value, fraction, flags=_FLAGS)
            value = builder.fadd(product, _constant(coefficient), flags=_FLAGS)
        shift = builder.shl(builder.bitcast(rounded, _INTS), ir.Constant(_INTS, [23] * LANES))
        return builder.bitcast(builder.add(builder.bitcast(value, _INTS), shift), _FLOATS)

    return VECTOR(VECTOR), generate


@_operation
def reciprocal(_typing, vector):
    """Return 1 / vector for normal positive numbers, relative error below 3e-7.

    An estimate refined by Newton's method, several times faster than a division: the CPU's own
    estimate where LLVM offers one, else the classic integer trick.
    """

    def generate(_context, builder, _signature, arguments):
        (vector,) = arguments
        if LANES == 16 and _FEATURES.get("avx512f"):
            mask_type = ir.IntType(16)
            estimate_function = cgutils.get_or_insert_function(
                builder.module,
                ir.FunctionType(_FLOATS, [_FLOATS, _FLOATS, mask_type]),
                "llvm.x86.avx512.rcp14.ps.512",
            )
            everywhere = ir.Constant(mask_type, 0xFFFF)
            inverse = builder.call(estimate_function, [vector, _constant(0.0), everywhere])
            steps = 1
        elif LANES == 8 and _FEATURES.get("avx"):
            estimate_function = cgutils.get_or_insert_function(
                builder.module, ir.FunctionType(_FLOATS, [_FLOATS]), "llvm.x86.avx.rcp.ps.256"
            )
            inverse = builder.call(estimate_function, [vector])
            steps = 1
        else:
            magic = ir.Constant(_INTS, [0x7EF311C3] * LANES)
            seed = builder.sub(magic, builder.bitcast(vector, _INTS))
            inverse = builder.bitcast(seed, _FLOATS)
            steps = 3
        for _ in range(steps):
            error = builder.fsub(
                _constant(2.0), builder.fmul(vector, inverse, flags=_FLAGS), flags=_FLAGS
            )
            inverse = builder.fmul(inverse, error, flags=_FLAGS)
        return inverse

    return VECTOR(VECTOR), generate
