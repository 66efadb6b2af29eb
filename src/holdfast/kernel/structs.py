"""The structs of the C kernel as types of NumPy, from their only definition: the C headers."""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from math import prod
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

C_TYPES: dict[str, npt.DTypeLike] = {
    "double": np.float64, "bool": np.bool_, "size_t": np.uintp, "int32_t": np.int32,
    "uint16_t": np.uint16, "uint32_t": np.uint32, "int64_t": np.int64, "uint64_t": np.uint64,
}  # fmt: skip
Structs = npt.NDArray[np.void]


class Field(NamedTuple):
    """Field of a struct in C.

    Attributes:
        name: of the field.
        kind: its type, or the type of its elements.
        length: expression of the number of elements, of an array.
        is_pointer: whether it is a pointer.
        is_sized: whether it is an array where sizes are macros, else a pointer (HF_ARRAY).
    """

    name: str
    kind: str
    length: str | None = None
    is_pointer: bool = False
    is_sized: bool = False


def fields_of(text: str) -> dict[str, list[Field]]:
    """Return the fields of each struct in a text of the kernel.

    Raises:
        ValueError: a line of a struct is no field.

    Example:
        >>> fields_of("typedef struct { double time; hf_real m[3]; } holdfast_x;")["holdfast_x"][1]
        Field(name='m', kind='hf_real', length='3', is_pointer=False, is_sized=False)
    """
    # Comments hold semicolons and braces too.
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    structs = {}
    for body, name in re.findall(r"typedef struct \{([^}]*)\} (holdfast_\w+);", text):
        fields: list[Field] = []
        for line in filter(None, (" ".join(part.split()) for part in body.split(";"))):
            sized = re.fullmatch(r"HF_ARRAY\((\w+), (\w+), (.+)\)", line)
            plain = re.fullmatch(r"(?:const )?(\w+) (\*?)(\w+)(?:\[(.+)\])?", line)
            if sized:
                fields.append(Field(sized[2], sized[1], sized[3], is_sized=True))
            elif plain:
                fields.append(Field(plain[3], plain[1], plain[4], is_pointer=bool(plain[2])))
            else:
                raise ValueError(f"struct {name}: a field, or HF_ARRAY, expected; {line!r} given")
        structs[name] = fields
    return structs


def constants_of(text: str) -> dict[str, int]:
    """Return the whole numbers that a text of the kernel defines by name."""
    numbers = re.findall(r"(?:\b([A-Z]\w+) =|#define ([A-Z]\w+)) (\d+)\b", text)
    return {name or macro: int(value) for name, macro, value in numbers}


def types_of(
    text: str, sizes: Mapping[str, int] | None = None, *, single: bool = False
) -> dict[str, np.dtype[Any]]:
    """Return the layout of each struct in memory, as a compiler of this machine has it.

    Args:
        text: of the kernel.
        sizes: macros of an exported header, in which the arrays of the memory are part of their
            structs; None for the extension, in which they are pointers.
        single: numbers but times are of single precision.
    """
    numbers = constants_of(text) | dict(sizes or {})
    types = {name: np.dtype(kind) for name, kind in C_TYPES.items()}
    types["hf_real"] = np.dtype(np.float32 if single else np.float64)
    for name, fields in fields_of(text).items():
        # A struct stands after those that it contains, as C needs it: all kinds are found.
        members: list[Any] = []
        for field in fields:
            if field.is_pointer or (field.is_sized and sizes is None):
                members.append((field.name, np.uintp))
            elif field.length is None:
                members.append((field.name, types[field.kind]))
            else:
                members.append((field.name, types[field.kind], (_length(field.length, numbers),)))
        types[name] = np.dtype(members, align=True)
    return types


def _length(expression: str, numbers: Mapping[str, int]) -> int:
    """Return a product of numbers, names and sums of two of them.

    Example:
        >>> _length("N * (M + 1) * 3", {"N": 2, "M": 4})
        30
    """
    text = re.sub(r"[A-Z]\w*", lambda name: str(numbers[name[0]]), expression)
    factors = re.sub(r"\((\d+) \+ (\d+)\)", lambda x: str(int(x[1]) + int(x[2])), text)
    return prod(map(int, factors.split("*")))


@cache
def _header() -> str:
    return (resources.files("holdfast.kernel") / "holdfast.h").read_text("utf-8")


@cache
def _extension_fields() -> dict[str, list[Field]]:
    return fields_of(_header())


@cache
def _extension_types() -> dict[str, np.dtype[Any]]:
    return types_of(_header())


def struct_type(name: str) -> np.dtype[Any]:
    """Return the layout of a struct of the extension, such as `holdfast_finger`."""
    return _extension_types()[name]


def structs(name: str, rows: Sequence[Mapping[str, Any]]) -> Structs:
    """Return structs of the extension with the values of rows; pointers are 0.

    Args:
        name: of the struct.
        rows: (n,) values of all fields that are no pointers, by name.

    Raises:
        KeyError: a row lacks a field.
        ValueError: a row has another field.
    """
    expected = [field.name for field in _extension_fields()[name] if not field.is_pointer]
    array = np.zeros(len(rows), struct_type(name))
    for row in rows:
        if unknown := row.keys() - set(expected):
            raise ValueError(f"{name}: fields {', '.join(expected)} expected, {unknown} given")
    for field in expected if rows else ():
        array[field] = [row[field] for row in rows]
    return array


def n_mask_words(n_taxels: int) -> int:
    """Return how many words of 64 bits a mask of taxels has."""
    return -(-n_taxels // 64)
