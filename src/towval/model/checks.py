"""Checks that the types share: locked arrays of a known shape, numbers in range."""

import math
import numbers
from collections.abc import Iterable
from dataclasses import fields
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model.errors import InputError, shortened

Array = NDArray[np.float64]


def locked(values: ArrayLike, name: str, shape: tuple[int | None, ...], *, finite: bool = True) -> Array:
    """A read-only float64 copy of ``values``, or ``values`` if locked already; None in ``shape`` leaves an axis free.

    Raises `InputError` with the ``name`` for no numbers, another shape and, where ``finite``, NaN and infinity.
    """
    array: Array = values if _is_locked(values) else np.array(numbers_of(values, name))
    _check_shape(array, name, shape)
    if finite and not np.isfinite(array).all():
        first = np.unravel_index(np.isfinite(array).argmin(), array.shape)
        where = f" at [{', '.join(map(str, first))}]" if first else ""
        raise InputError(
            f"{name} holds values that are not finite", got=f"{array[first]}{where}", allowed="finite numbers"
        )
    array.setflags(write=False)
    return array


def _check_shape(array: np.ndarray, name: str, shape: tuple[int | None, ...]) -> None:
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape, strict=True)):
        wanted = " × ".join("any" if n is None else str(n) for n in shape)
        raise InputError(f"{name} has the wrong shape", got=array.shape, allowed=wanted)


def increasing(times_s: Array, name: str, least: int = 0) -> None:
    """Refuse times (n,) [s] that do not strictly increase, and fewer than ``least``."""
    falls = np.flatnonzero(~(np.diff(times_s) > 0))
    if len(times_s) < least or len(falls):
        pair = times_s[falls[0] : falls[0] + 2] if len(falls) else None
        raise InputError(
            f"{name} are too few or do not increase" if least else f"{name} do not increase",
            got=f"{len(times_s)} of them" if pair is None else f"{pair[1]:.12g} s after {pair[0]:.12g} s",
            allowed=f"{least} or more, strictly increasing" if least else "strictly increasing times",
        )


def numbers_of(values: ArrayLike, name: str, width: int | None = None) -> Array:
    """``values`` as float64, not copied where they are that already; ``width`` is that of the last axis.

    Raises `InputError` with the ``name`` for no numbers and another width. NaN stands for what is missing.
    """
    try:
        array: Array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} is no array of numbers", got=_brief(values), allowed="numbers") from None
    if width is not None and (array.ndim == 0 or array.shape[-1] != width):
        raise InputError(f"{name} has the wrong shape", got=array.shape, allowed=f"{width} numbers in the last axis")
    return array


def items_of(values: Iterable[Any], name: str) -> tuple[Any, ...]:
    """The items of a list or tuple; raises `InputError` with the ``name`` for what has none."""
    try:
        return tuple(values)
    except TypeError:
        raise InputError(f"{name} is no list", got=_brief(values), allowed="a list or tuple") from None


def matching(*named: tuple[Array, str]) -> None:
    """Refuse arrays whose axes but the last do not go together."""
    try:
        np.broadcast_shapes(*(array.shape[:-1] for array, _ in named))
    except ValueError:
        names = " and ".join(name for _, name in named)
        got = ", ".join(str(array.shape) for array, _ in named)
        raise InputError(
            f"{names} do not match", got=got, allowed="one for each of the others, or one for all"
        ) from None


def _is_locked(values: ArrayLike) -> TypeGuard[Array]:
    """Whether values are a read-only float64 array whose underlying memory is read-only as well."""
    if type(values) is not np.ndarray or values.dtype != np.float64 or values.flags.writeable:
        return False
    owner = values if values.base is None else values.base
    return type(owner) is np.ndarray and owner.flags.owndata and not owner.flags.writeable


def lock(self: object, *, finite: bool = True, **shapes: tuple[int | None, ...]) -> None:
    """Lock the named fields of a frozen dataclass in place; see :func:`locked`."""
    for name, shape in shapes.items():
        value = locked(getattr(self, name), f"{type(self).__name__}.{name}", shape, finite=finite)
        object.__setattr__(self, name, value)


def lock_whole(self: object, kind: type[np.integer[Any]], **shapes: tuple[int | None, ...]) -> None:
    """Make read-only copies of the named fields of a frozen dataclass, whole numbers of a kind; see :func:`locked`."""
    for name, shape in shapes.items():
        values = np.array(getattr(self, name), dtype=kind)
        _check_shape(values, f"{type(self).__name__}.{name}", shape)
        values.setflags(write=False)
        object.__setattr__(self, name, values)


def positive(self: object, *names: str, zero: bool = False) -> None:
    """Refuse named fields that are not finite numbers above zero; ``zero`` allows zero as well."""
    for name in names:
        value = getattr(self, name)
        # Floats first: the check against an abstract base class is slow.
        if type(value) is not float and (isinstance(value, bool) or not isinstance(value, numbers.Real)):
            raise InputError(f"{type(self).__name__}.{name} is no number", got=_brief(value), allowed="a number")
        number = _float(value)
        if not (math.isfinite(number) and (number > 0 or (zero and number == 0))):
            allowed = "a finite number, zero or more" if zero else "a finite number above zero"
            raise InputError(f"{type(self).__name__}.{name} is out of range", got=value, allowed=allowed)


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def within(self: object, section: str, unit: str = "", /, **limits: tuple[float, float]) -> None:
    """Refuse named settings of a section of config.yaml that are below or above their limits."""
    for name, (low, high) in limits.items():
        if not low <= getattr(self, name) <= high:
            allowed = f"{low:g} to {high:g} {unit}".strip()
            raise InputError(f"{section}.{name} is out of range", got=getattr(self, name), allowed=allowed)


def instance_of(value: object, name: str, *kinds: type) -> None:
    """Refuse an argument that is of none of the types."""
    if not isinstance(value, kinds):
        allowed = " or ".join(kind.__name__ for kind in kinds)
        raise InputError(f"{name} is of the wrong type", got=_brief(value), allowed=allowed)


def short_repr(self: Any) -> str:
    """A ``__repr__`` for results: long arrays and tuples by their size, one field a line."""
    named = [(name, getattr(self, name)) for name in getattr(self, "_fields", None) or (f.name for f in fields(self))]
    return f"{type(self).__name__}(\n" + "".join(f"  {name}={_brief(value)},\n" for name, value in named) + ")"


def _brief(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > 6:
        return f"<array {' × '.join(map(str, value.shape))}>"
    if isinstance(value, np.ndarray):
        return str(value.tolist())
    if (isinstance(value, tuple | list | dict) and len(value) > 3) or (isinstance(value, tuple) and value):
        return f"<{len(value)} item{'s' * (len(value) > 1)}>"
    if hasattr(value, "__dataclass_fields__") or hasattr(value, "_fields"):
        return f"<{type(value).__name__}>"
    return shortened(repr(value))
