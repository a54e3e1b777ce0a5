"""Vectors of float32 numbers in numba kernels, for loops too short for LLVM's own vectoriser, or of arrays that may
overlap as far as it knows.

In a kernel, `load(array, i)` is array[i:i + LANES] as one value, `repeat(array, i)` is LANES times array[i], and
`store(array, i, v)` writes a vector back: arrays are contiguous (N,), and no bound is checked. + - * / take vectors and
numbers. LLVM uses as many of the processor's registers as a vector needs. Operations are not reordered, so that a
kernel gives the same bits however it was compiled.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

LANES = 16                 # a register of AVX-512, two of AVX2, four of NEON
_FLOATS = ir.VectorType(ir.FloatType(), LANES)
_ZEROS = ir.Constant(_FLOATS, [0.0] * LANES)
_FLAGS = ("contract", "nsz")


class Vector(types.Type):
    """The numba type of LANES float32 numbers."""


vector = Vector("vector")


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _FLOATS)


def _address(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    return builder.gep(context.make_array(kind)(context, builder, array).data, [index])


def _choice(lanes: list[int]) -> Any:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), lanes)


def _repeated(builder: Any, number: Any) -> Any:
    first = builder.insert_element(ir.Constant(_FLOATS, ir.Undefined), number, ir.IntType(32)(0))
    return builder.shuffle_vector(first, first, _choice([0] * LANES))


@intrinsic
def load(typing: Any, array: Any, index: Any) -> Any:
    """array[index:index + LANES]"""
    def generate(context, builder, signature, arguments):
        place = _address(context, builder, array, *arguments)
        return builder.load(builder.bitcast(place, _FLOATS.as_pointer()), align=4)
    return vector(array, types.intp), generate


@intrinsic
def repeat(typing: Any, array: Any, index: Any) -> Any:
    """LANES times array[index]."""
    def generate(context, builder, signature, arguments):
        return _repeated(builder, builder.load(_address(context, builder, array, *arguments)))
    return vector(array, types.intp), generate


@intrinsic
def store(typing: Any, array: Any, index: Any, value: Any) -> Any:
    """array[index:index + LANES] = value"""
    def generate(context, builder, signature, arguments):
        place = _address(context, builder, array, *arguments[:2])
        builder.store(arguments[2], builder.bitcast(place, _FLOATS.as_pointer()), align=4)
        return context.get_dummy_value()
    return types.void(array, types.intp, vector), generate


@intrinsic
def zeros(typing: Any) -> Any:
    """The vector of zeros."""
    return vector(), lambda context, builder, signature, arguments: _ZEROS


@intrinsic
def count_up(typing: Any, first: Any) -> Any:
    """first, first + 1, …, first + LANES - 1"""
    def generate(context, builder, signature, arguments):
        steps = ir.Constant(_FLOATS, [float(lane) for lane in range(LANES)])
        return builder.fadd(_repeated(builder, arguments[0]), steps)
    return vector(types.float32), generate


@intrinsic
def at_least(typing: Any, number: Any, bound: Any, value: Any) -> Any:
    """The vector `value` in the lanes where number >= bound, 0 in the others, whatever `value` is there."""
    def generate(context, builder, signature, arguments):
        number, bound, value = arguments
        return builder.select(builder.fcmp_ordered(">=", number, _repeated(builder, bound)), value, _ZEROS)
    return vector(vector, types.float32, vector), generate


@intrinsic
def total(typing: Any, value: Any) -> Any:
    """The sum of the lanes: the one half is added to the other until one number is left."""
    def generate(context, builder, signature, arguments):
        value, width = arguments[0], LANES
        while width > 1:
            width //= 2
            value = builder.fadd(*(builder.shuffle_vector(value, value, _choice(list(range(first, first + width))))
                                   for first in (0, width)))
        return builder.extract_element(value, ir.IntType(32)(0))
    return types.float32(vector), generate


def _limit(comparison: str) -> Any:
    @intrinsic
    def call(typing: Any, value: Any, bound: Any) -> Any:
        def generate(context, builder, signature, arguments):
            value, bound = arguments[0], _repeated(builder, arguments[1])
            return builder.select(builder.fcmp_ordered(comparison, value, bound), value, bound)
        return vector(vector, types.float32), generate
    return call


at_most, no_less = _limit("<"), _limit(">")  # of a vector and a number: the smaller of the two, and the larger


def _teach(symbol: Any, instruction: str) -> None:
    """Let `symbol` take two vectors, or a vector and a number."""
    @type_callable(symbol)
    def _result(context: Any) -> Any:
        def result(a: Any, b: Any) -> Any:
            if vector in (a, b) and all(kind == vector or isinstance(kind, types.Number) for kind in (a, b)):
                return vector
        return result

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        a, b = (value if kind == vector else _repeated(builder, context.cast(builder, value, kind, types.float32))
                for value, kind in zip(arguments, signature.args, strict=True))
        return getattr(builder, instruction)(a, b, flags=(*_FLAGS, "arcp") if instruction == "fdiv" else _FLAGS)

    for kinds in ((Vector, Vector), (Vector, types.Number), (types.Number, Vector)):
        lower_builtin(symbol, *kinds)(generate)


for _name, _instruction in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    for _symbol in (getattr(operator, _name), getattr(operator, f"i{_name}")):  # a + b and a += b
        _teach(_symbol, _instruction)
