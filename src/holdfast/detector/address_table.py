"""Arrays of a kernel as one table of addresses, by the fields of a named tuple.

A compiled function unwraps every array that it receives, at 50 ns each. For the arrays of a
detector that is a fifth of an update. So the kernel receives one table, and makes the named tuple
from it. The annotations of the tuple are the only definition: an array has a row with its address
and its shape, a number has that of an array with one element, and a field that is a named tuple
has the rows of its own fields. `reader_source` and `table_of` follow the same order.
"""

import hashlib
from collections.abc import Iterator
from itertools import count
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
import numpy.typing as npt
from numba import types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from holdfast.compiled import compiled_view, inlined
from holdfast.features.arrays import ArrayKind
from holdfast.sensors.types import Integers

Function = TypeVar("Function")
Arrays = list[npt.NDArray[Any]]

MAX_AXES = 3
NUMBERS = {
    kind: ArrayKind(dtype, 1)
    for kind, dtype in ((int, np.int64), (float, np.float64), (bool, np.bool_))
}


def _cast(_typing: Any, address: Any) -> Any:  # noqa: ANN401 (numba's own objects)
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ANN401
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.voidptr(address), generate


pointer: Any = intrinsic(_cast)
"""Pointer to an address."""


class TupleField(NamedTuple):
    """Field of a named tuple: its name, and its kind if it is an array or a number."""

    name: str
    type: Any  # a named tuple if there is no kind
    kind: ArrayKind | None


def fields_of(definition: type) -> list[TupleField]:
    """Return the fields of a named tuple.

    Raises:
        TypeError: a field is neither an array, nor a number, nor a named tuple.
    """
    fields = []
    for name, hint in get_type_hints(definition, include_extras=True).items():
        kind = NUMBERS.get(hint) or next(iter(getattr(hint, "__metadata__", ())), None)
        if not (isinstance(kind, ArrayKind) or hasattr(hint, "_fields")):
            raise TypeError(f"{definition.__name__}.{name}: an array or a number expected, {hint}")
        fields.append(TupleField(name, hint, kind))
    return fields


def table_of(values: Any) -> tuple[Integers, Arrays]:  # noqa: ANN401 (any named tuple)
    """Return the table of a named tuple, and the arrays that must live as long.

    The caller must not resize or replace the arrays while the table is in use. A change of a
    number in the tuple has no effect.

    Returns:
        (n_arrays, 4) address and shape of each array, and the arrays.

    Raises:
        ValueError: an array has another type or number of axes than its field, or is not
            contiguous.
    """
    arrays = list(_arrays_of(values))
    table = np.zeros((len(arrays), 1 + MAX_AXES), dtype=np.int64)
    for row, array in zip(table, arrays, strict=True):
        row[0] = array.ctypes.data
        row[1 : 1 + array.ndim] = array.shape
    return table, arrays


def _arrays_of(values: Any) -> Iterator[npt.NDArray[Any]]:  # noqa: ANN401
    for (name, _, kind), value in zip(fields_of(type(values)), values, strict=True):
        if kind is None:
            yield from _arrays_of(value)
            continue
        array = value if isinstance(value, np.ndarray) else np.array([value], dtype=kind.dtype)
        if not (kind.fits(array) and array.flags.c_contiguous):
            raise ValueError(
                f"{type(values).__name__}.{name}: a contiguous array of {kind.n_axes} axes of "
                f"{kind.dtype.__name__} expected, {array.ndim} axes of {array.dtype} given"
            )
        yield array


def reader_source(definition: type) -> str:
    """Return the source text of a function from a table to a named tuple.

    Example:
        >>> from holdfast.features.arrays import Floats2, Integers1
        >>> class Two(NamedTuple):
        ...     offsets: Integers1
        ...     forces: Floats2
        ...     period: float
        >>> print(reader_source(Two))
        def read_Two(table):
            return Two(int64_1(table, 0), float64_2(table, 1), float64_1(table, 2)[0])
    """
    return f"def read_{definition.__name__}(table):\n    return {_call(definition, count())}"


def _call(definition: type, places: Iterator[int]) -> str:
    parts = []
    for _, hint, kind in fields_of(definition):
        if kind is None:
            parts.append(_call(hint, places))
        else:
            item = "[0]" if hint in NUMBERS else ""
            parts.append(f"{_view_name(kind)}(table, {next(places)}){item}")
    return f"{definition.__name__}({', '.join(parts)})"


def _view_name(kind: ArrayKind) -> str:
    return f"{kind.dtype.__name__.rstrip('_')}_{kind.n_axes}"


def _view_source(kind: ArrayKind) -> str:
    """Return the source text of a function that returns array i of a table."""
    shape = "".join(f"table[i, {axis}], " for axis in range(1, 1 + kind.n_axes))
    name, dtype = _view_name(kind), kind.dtype.__name__
    return f"def {name}(table, i):\n    return carray(pointer(table[i, 0]), ({shape}), np.{dtype})"


def _names_of(definition: type) -> dict[str, Any]:
    """Return the functions and classes that the source text of a reader names."""
    names: dict[str, Any] = {definition.__name__: definition}
    for _, hint, kind in fields_of(definition):
        if kind is None:
            names |= _names_of(hint)
        elif _view_name(kind) not in names:
            names[_view_name(kind)] = compiled_view(_run(_view_source(kind), _view_name(kind), {}))
    return names


def _run(source: str, name: str, names: dict[str, Any]) -> Any:  # noqa: ANN401 (a function)
    """Return the function that a source text defines; numba keeps it beside this file."""
    scope = {"__name__": __name__, "np": np, "carray": carray, "pointer": pointer, **names}
    exec(compile(source, __file__, "exec"), scope)
    return scope[name]


def reader_of(definition: type) -> Any:  # noqa: ANN401 (a function that returns the definition)
    """Return a function from a table to a named tuple, to be inlined into a kernel."""
    name = f"read_{definition.__name__}"
    return inlined(_run(reader_source(definition), name, _names_of(definition)))


def kept_by(definition: type) -> Any:  # noqa: ANN401 (a decorator)
    """Return a decorator that names a function by the table that it reads.

    Numba keeps compiled functions by their names and types, and a table has always the same
    type. Without this, it would read a table of the last version after a change of a field.
    """
    digest = hashlib.sha256(reader_source(definition).encode()).hexdigest()[:12]

    def rename(function: Function) -> Function:
        function.__qualname__ += f"_{digest}"  # type: ignore[attr-defined]
        return function

    return rename
