"""Four numbers side by side, which compiled code multiplies and adds in one instruction.

Numba packs loops into vector registers but not straight-line code, and the four radial means of a friction law (see
``friction_table``) are the latter: the same polynomial with four sets of coefficients. LLVM's own vectors of four
doubles say so outright; where a machine has narrower registers it splits them.

The functions here can be called in compiled code alone.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, register_model
from numba.np import arrayobj

_WIDTH = 4
_VECTOR = ir.VectorType(ir.DoubleType(), _WIDTH)
_INDEX = ir.IntType(32)


class Lanes(types.Type):
    """Numba's type of four doubles in one register."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


_LANES = Lanes()


def _intrinsic(function: Callable[..., Any]) -> Callable[..., Any]:
    """Numba's decorator; in compiled code the function takes neither context nor types but the values."""
    made: Callable[..., Any] = intrinsic(function)
    return made


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, numba_type: types.Type) -> None:
        models.PrimitiveModel.__init__(self, manager, numba_type, _VECTOR)


@_intrinsic
def lanes(typing_context: Any, a: types.Type, b: types.Type, c: types.Type, d: types.Type) -> tuple[Any, Any]:
    """Four floats as lanes."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: tuple[Any, ...]) -> ir.Value:
        vector = ir.Constant(_VECTOR, ir.Undefined)
        for i, value in enumerate(arguments):
            vector = builder.insert_element(vector, value, ir.Constant(_INDEX, i))
        return vector

    return _LANES(*(types.float64,) * _WIDTH), generate


@_intrinsic
def load_lanes(typing_context: Any, array: types.Array, index: types.Type) -> tuple[Any, Any]:
    """The four floats of a contiguous array from an index on, which is not checked."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: tuple[Any, ...]) -> ir.Value:
        data = arrayobj.make_array(signature.args[0])(context, builder, arguments[0]).data
        first = builder.bitcast(builder.gep(data, [arguments[1]]), _VECTOR.as_pointer())
        return builder.load(first, align=8)

    return _LANES(array, types.uint64), generate


@_intrinsic
def multiply_add(typing_context: Any, a: types.Type, b: types.Type, c: types.Type) -> tuple[Any, Any]:
    """``a b + c`` of lanes, lane by lane, with one rounding."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: tuple[Any, ...]) -> ir.Value:
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.fma.v{_WIDTH}f64"), arguments)

    return _LANES(_LANES, _LANES, _LANES), generate


@_intrinsic
def multiply(typing_context: Any, a: types.Type, b: types.Type) -> tuple[Any, Any]:
    """``a b`` of lanes, lane by lane."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: tuple[Any, ...]) -> ir.Value:
        return builder.fmul(*arguments)

    return _LANES(_LANES, _LANES), generate


@_intrinsic
def unpacked(typing_context: Any, vector: types.Type) -> tuple[Any, Any]:
    """The four lanes as a tuple of floats."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: tuple[Any, ...]) -> ir.Value:
        values = [builder.extract_element(arguments[0], ir.Constant(_INDEX, i)) for i in range(_WIDTH)]
        return context.make_tuple(builder, signature.return_type, values)

    return types.UniTuple(types.float64, _WIDTH)(_LANES), generate
