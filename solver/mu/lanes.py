"""Compiled: eight numbers side by side in vector registers, with exp and log of their own.

A `Lanes` is a vector of `WIDTH` doubles in compiled code, a `Mask` one of truth values; neither
exists outside. Their operators are single instructions of LLVM, which any processor has, in
narrower registers if need be. A product and a sum may be contracted to one rounding.
"""

from __future__ import annotations

import operator

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from solver.mu.workspace import inner

__all__ = [
    "WIDTH", "any_of", "exp", "fill", "load", "log", "magnitude", "maximum", "minimum", "pick",
    "root", "store",
]  # fmt: skip

WIDTH = 8
_DOUBLES = ir.VectorType(ir.DoubleType(), WIDTH)
_INTEGERS = ir.VectorType(ir.IntType(64), WIDTH)
_TRUTHS = ir.VectorType(ir.IntType(1), WIDTH)
_ALIGNED = 8  # bytes: arrays promise no more


class _LanesType(types.Type):
    def __init__(self) -> None:
        super().__init__(name="Lanes")


class _MaskType(types.Type):
    def __init__(self) -> None:
        super().__init__(name="Mask")


_LANES, _MASK = _LanesType(), _MaskType()


@register_model(_LanesType)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc] # numba has no types
    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, _DOUBLES)


@register_model(_MaskType)
class _MaskModel(models.PrimitiveModel):  # type: ignore[misc] # the same
    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, _TRUTHS)


def _spread(builder, value):
    """One number in all lanes."""
    one = builder.insert_element(
        ir.Constant(_DOUBLES, ir.Undefined), value, ir.Constant(ir.IntType(32), 0)
    )
    order = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(_DOUBLES, ir.Undefined), order)


def _both(builder, signature, values):
    """Both operands as lanes."""
    return (
        value if kind == _LANES else _spread(builder, value)
        for kind, value in zip(signature.args, values, strict=True)
    )


def _define(operation, result, build):
    """Let compiled code apply `operation` to lanes and lanes, or lanes and a float."""

    @type_callable(operation)
    def _typed(context):
        def typer(a, b):
            floats = isinstance(a, types.Float) or isinstance(b, types.Float)
            both = a == _LANES and b == _LANES
            return result if both or (floats and _LANES in {a, b}) else None

        return typer

    for kinds in ((_LANES, _LANES), (_LANES, types.Float), (types.Float, _LANES)):

        @lower_builtin(operation, *kinds)
        def _built(context, builder, signature, values):
            return build(builder, *_both(builder, signature, values))


def _arithmetic(name):
    return lambda builder, a, b: getattr(builder, name)(a, b, flags=("contract",))


def _comparison(sign):
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


for _operation, _name in (
    (operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):  # fmt: skip
    _define(_operation, _LANES, _arithmetic(_name))
    _define(getattr(operator, f"i{_operation.__name__}"), _LANES, _arithmetic(_name))
for _operation, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="),
):  # fmt: skip
    _define(_operation, _MASK, _comparison(_sign))


@type_callable(operator.neg)
def _typed_negative(context):
    return lambda a: a if a == _LANES else None


@lower_builtin(operator.neg, _LANES)
def _negative(context, builder, signature, values):
    return builder.fneg(values[0])


@type_callable(operator.invert)
def _typed_invert(context):
    return lambda a: a if a == _MASK else None


@lower_builtin(operator.invert, _MASK)
def _invert(context, builder, signature, values):
    return builder.not_(values[0])


for _operation, _name in ((operator.and_, "and_"), (operator.or_, "or_")):

    @type_callable(_operation)
    def _typed_logic(context):
        return lambda a, b: _MASK if a == _MASK and b == _MASK else None

    @lower_builtin(_operation, _MASK, _MASK)
    def _logic(context, builder, signature, values, name=_name):
        return getattr(builder, name)(*values)


def _place(context, builder, kind, array, row):
    """Address of a row of `WIDTH` doubles."""
    data = context.make_array(kind)(context, builder, array).data
    first = builder.mul(row, ir.Constant(row.type, WIDTH))
    return builder.bitcast(builder.gep(data, [first]), _DOUBLES.as_pointer())


@intrinsic
def load(typing, array, row):
    """Lanes of a row of a contiguous array (rows, `WIDTH`)."""

    def build(context, builder, signature, values):
        address = _place(context, builder, signature.args[0], *values)
        return builder.load(address, align=_ALIGNED)

    return _LANES(array, types.intp), build


@intrinsic
def store(typing, array, row, value):
    """Put lanes into a row of a contiguous array (rows, `WIDTH`)."""

    def build(context, builder, signature, values):
        address = _place(context, builder, signature.args[0], *values[:2])
        builder.store(values[2], address, align=_ALIGNED)
        return context.get_dummy_value()

    return types.void(array, types.intp, value), build


@intrinsic
def fill(typing, number):
    """One number in all lanes."""
    return _LANES(number), lambda context, builder, signature, values: _spread(builder, values[0])


@intrinsic
def pick(typing, mask, a, b):
    """Lanes of `a` where `mask` holds, of `b` elsewhere."""

    def build(context, builder, signature, values):
        return builder.select(*values)

    return _LANES(mask, a, b), build


@intrinsic
def any_of(typing, mask):
    """Whether `mask` holds in any lane."""

    def build(context, builder, signature, values):
        bits = builder.bitcast(values[0], ir.IntType(WIDTH))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return types.boolean(mask), build


def _called(name):
    """Build a call of LLVM's own function of one vector."""

    def build(context, builder, signature, values):
        kind = ir.FunctionType(_DOUBLES, [_DOUBLES])
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{WIDTH}f64")
        return builder.call(function, values)

    return build


@intrinsic
def root(typing, a):
    """Square root."""
    return _LANES(a), _called("sqrt")


@intrinsic
def magnitude(typing, a):
    """Absolute value."""
    return _LANES(a), _called("fabs")


@inner
def minimum(a, b):
    """Lesser of two; `b` where they cannot be compared."""
    return pick(a < b, a, b)


@inner
def maximum(a, b):
    """Greater of two; `b` where they cannot be compared."""
    return pick(a > b, a, b)


@intrinsic
def _times_power(typing, a, shifted):
    """Return a times 2^k, k in the last bits of `shifted`, by adding it to the exponent."""

    def build(context, builder, signature, values):
        bits, power = (builder.bitcast(value, _INTEGERS) for value in values)
        power = builder.shl(power, ir.Constant(_INTEGERS, [52] * WIDTH))
        return builder.bitcast(builder.add(bits, power), _DOUBLES)

    return _LANES(a, shifted), build


@intrinsic
def _split(typing, a):
    """Exponent k and m in [sqrt 1/2, sqrt 2) of a = 2^k m > 0."""

    def build(context, builder, signature, values):
        bits = builder.bitcast(values[0], _INTEGERS)
        root_half = ir.Constant(_INTEGERS, [0x3FE6A09E667F3BCD] * WIDTH)
        digits = ir.Constant(_INTEGERS, [52] * WIDTH)
        power = builder.ashr(builder.sub(bits, root_half), digits)
        rest = builder.bitcast(builder.sub(bits, builder.shl(power, digits)), _DOUBLES)
        parts = [builder.sitofp(power, _DOUBLES), rest]
        return context.make_tuple(builder, signature.return_type, parts)

    return types.UniTuple(_LANES, 2)(a), build


SHIFT = 1.5 * 2.0**52  # what is added to it is rounded to an integer, its last bits
LOG2_E = 1.4426950408889634
LN_2_HIGH = 5954088943 / 2**33  # first digits of log 2: a multiple by an exponent is exact
LN_2_LOW = 7.440617110012397e-11  # and what follows them
LARGEST_POWER = 690.0  # exp stays a normal number


@inner
def exp(a):
    """Exponential, to two units in the last place; of +-690 beyond that.

    Taylor's polynomial of degree 13 on |r| < ln 2/2: its remainder is below 1e-17.
    """
    a = minimum(maximum(a, fill(-LARGEST_POWER)), fill(LARGEST_POWER))
    shifted = a * LOG2_E + SHIFT
    power = shifted - SHIFT
    r = (a - power * LN_2_HIGH) - power * LN_2_LOW
    r2 = r * r
    r4 = r2 * r2
    low = (1.0 + r) + r2 * (1.0 / 2.0 + r * (1.0 / 6.0))
    middle = (1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0 + r * (1.0 / 5040.0))
    high = (1.0 / 40320.0 + r * (1.0 / 362880.0)) + r2 * (1.0 / 3628800.0 + r * (1.0 / 39916800.0))
    last = r * (1.0 / 6227020800.0) + 1.0 / 479001600.0
    return _times_power(low + r4 * (middle + r4 * (high + r4 * last)), shifted)


@inner
def log(a):
    """Natural logarithm of normal numbers > 0, to two units in the last place; others: no meaning.

    log m = 2 artanh z with z = (m - 1)/(m + 1), |z| < 0.172: ten terms leave 1e-18.
    """
    power, m = _split(a)
    z = (m - 1.0) / (m + 1.0)
    s = z * z
    s2 = s * s
    s4 = s2 * s2
    low = (1.0 / 3.0 + s * (1.0 / 5.0)) + s2 * (1.0 / 7.0 + s * (1.0 / 9.0))
    middle = (1.0 / 11.0 + s * (1.0 / 13.0)) + s2 * (1.0 / 15.0 + s * (1.0 / 17.0))
    high = (1.0 / 19.0 + s * (1.0 / 21.0)) + s2 * (1.0 / 23.0)
    series = low + s4 * (middle + s4 * high)
    return power * LN_2_HIGH + (2.0 * z + (2.0 * z * s * series + power * LN_2_LOW))
