"""Arrays of a file, which are read when they are needed, and arrays of records."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

KIND_NAMES = ("type", "topic", "kind", "channel")
"""Names in records of what kind a record is."""
ID_NAMES = ("id", "index", "number", "taxel", "taxel_id")
"""Names in the records of a list of the taxel that a record is of."""


class StoredArray(NamedTuple):
    """An array that is read when it is needed.

    Attributes:
        shape: its shape.
        kind: of its values, as in NumPy: `f`, `i`, `U` for text.
        read: reads it.
        columns: names of its columns, if they are known.
    """

    shape: tuple[int, ...]
    kind: str
    read: Callable[[], npt.NDArray[Any]]
    columns: tuple[str, ...] = ()


StoredArrays = Mapping[str, StoredArray]
"""Arrays of a file by path: names of groups and of the array with slashes between them."""


def in_memory(values: npt.NDArray[Any], columns: Sequence[str] = ()) -> StoredArray:
    """Return an array that is in memory; dates become seconds."""
    if values.dtype.kind == "M":
        values = values.astype("M8[ns]").astype(np.int64) * 1e-9
    return StoredArray(values.shape, values.dtype.kind, lambda: values, tuple(columns))


def arrays_of_records(records: Iterable[Mapping[str, Any]]) -> dict[str, StoredArray]:
    """Return arrays of the values in records, such as lines of JSON or messages of ROS.

    Records with arrays of the same names and shapes are one group; those of the largest group have
    paths without a first name. Of a list of records with x, y and z, such as fx, fy and fz, the
    three become one array, in the order of the ids of the records. Numbers beside their `shape`
    have it. A number that most records of a group have is NaN in the others; all else that not all
    have is left out.

    Args:
        records: values by name: numbers, texts, lists of numbers or of records, and records.
    """
    groups: dict[tuple[object, ...], list[dict[str, Any]]] = {}
    for record in records:
        leaves = dict(_leaves(record, ""))
        kinds = tuple(leaves.get(name) for name in KIND_NAMES)
        shapes = ((name, np.shape(x)) for name, x in leaves.items() if np.ndim(x))
        groups.setdefault((*kinds, *sorted(shapes)), []).append(leaves)
    with_arrays = [key for key in groups if len(key) > len(KIND_NAMES)] or list(groups)
    arrays: dict[str, StoredArray] = {}
    for k, key in enumerate(sorted(with_arrays, key=lambda key: -len(groups[key]))):
        rows = groups[key]
        words = [word for word in key[: len(KIND_NAMES)] if isinstance(word, str)]
        prefix = "" if len(with_arrays) == 1 else f"{'/'.join(words) or f'part{k + 1}'}/"
        for name in dict.fromkeys(name for row in rows for name in row):
            values = [row[name] for row in rows if name in row]
            forms = {(np.shape(x), isinstance(x, str)) for x in values}
            is_number = forms == {((), False)}
            if is_number and 2 * len(values) > len(rows):
                values = [row.get(name, np.nan) for row in rows]
            if len(values) == len(rows) and len(forms) == 1:
                arrays.setdefault(prefix + name, in_memory(np.array(values)))
    return arrays


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:  # noqa: ANN401 (any JSON value)
    """Yield the numbers, texts and arrays of numbers in a value, by path."""
    if isinstance(value, Mapping) and value.keys() == {*"xyz"} and path:  # a vector of ROS
        yield path, np.array([value[axis] for axis in "xyz"], dtype=np.float64)
    elif isinstance(value, Mapping):
        sizes = np.ravel(value["shape"]) if np.ndim(value.get("shape", 0)) == 1 else ()
        for key, x in value.items():
            is_shaped = len(sizes) and np.ndim(x) == 1 and np.size(x) == np.prod(sizes)
            part = np.reshape(x, [int(n) for n in sizes]) if is_shaped and key != "shape" else x
            if key != "shape" or not len(sizes):
                yield from _leaves(part, f"{path}/{key}" if path else str(key))
    elif isinstance(value, list) and value and all(isinstance(x, Mapping) for x in value):
        rows = [dict(_leaves(x, "")) for x in value]
        ids = [[row.get(name) for row in rows] for name in ID_NAMES]
        with suppress(TypeError):  # an id that is no number
            for numbers in ids:
                if None not in numbers and len(set(numbers)) == len(rows):
                    rows = [rows[k] for k in np.argsort(np.array(numbers, dtype=np.float64))]
                    break
        columns = {
            name: np.array([row[name] for row in rows], dtype=np.float64)
            for name in rows[0]
            if all(np.shape(row.get(name, "")) == np.shape(rows[0][name]) for row in rows)
            and not any(isinstance(row[name], str) for row in rows)
        }
        for name, column in joined_axes(columns).items():
            yield f"{path}/{name}", column
    elif isinstance(value, list | np.ndarray):
        with suppress(ValueError, TypeError):  # texts, or lists of several lengths
            yield path, np.array(value, dtype=np.float64)
    elif isinstance(value, str | int | float):
        yield path, value


def joined_axes(columns: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays; x, y and z of one name are joined to one array, the axis last.

    Example:
        >>> joined_axes({axis: np.zeros(4) for axis in ("fx", "fy", "fz")})["f"].shape
        (4, 3)
    """
    joined_columns = dict(columns)
    for name in columns:
        triple = [re.sub(r"x(?=$|[\W_])", axis, name) for axis in "xyz"]
        if len(set(triple)) == 3 and all(x in joined_columns for x in triple):
            joined = re.sub(r"[\W_]?x(?=$|[\W_])", "", name) or "xyz"
            if joined not in joined_columns:
                joined_columns[joined] = np.stack([joined_columns.pop(x) for x in triple], axis=-1)
    return joined_columns
