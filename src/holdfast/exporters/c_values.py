"""Values of a function that is translated to C: numbers, arrays and named tuples.

A value is the text of a C expression with what is known of it before the program runs. A number
that is known needs no text, and a branch that depends on it alone is left out.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

KnownNumber = bool | int | float
BOOL, INTEGER, REAL, EXACT_TIME = "bird"
"""Kinds of numbers. EXACT_TIME is a real number that stays double in single precision."""
C_TYPES = {BOOL: "bool", INTEGER: "int64_t", REAL: "holdfast_real", EXACT_TIME: "double"}
LEAST_SINGLE = float(np.finfo(np.float32).tiny)
"""Constants closer to zero become this number in a header of single precision."""


class CNumber(NamedTuple):
    """KnownNumber: its kind and its C expression, or its value if that is known."""

    kind: str
    text: str
    known: KnownNumber | None = None

    @property
    def key(self) -> object:
        """What a function that receives it depends on."""
        return (self.kind, repr(self.known))


class CArray(NamedTuple):
    """Array, or a part of one that is not contiguous.

    Attributes:
        kind: of its elements.
        base: C expression of a pointer.
        shape: length of each axis.
        strides: of each axis, in elements.
        field: name of the whole array.
        offsets: C expressions whose sum is the place of its first element.
        choices: (n, *shape) all values that it may have, for a constant array; else None.
    """

    kind: str
    base: str
    shape: tuple[CNumber, ...]
    strides: tuple[int, ...]
    field: str
    offsets: tuple[str, ...] = ()
    choices: npt.NDArray[Any] | None = None

    @property
    def key(self) -> object:
        """What a function that receives it depends on."""
        choices = None if self.choices is None else self.choices.tobytes()
        shape = tuple(length.known for length in self.shape)
        return (self.kind, shape, self.strides, self.field, self.is_whole, choices)

    @property
    def text(self) -> str:
        """C expression of a pointer to the first element."""
        return f"({' + '.join((self.base, *self.offsets))})" if self.offsets else self.base

    @property
    def is_whole(self) -> bool:
        """Whether it is an array of the header, which every function reaches by its name."""
        return not self.offsets and self.base in (f"d->{self.field}", self.field)

    @property
    def needs_detector(self) -> bool:
        """Whether a function reaches it by the detector."""
        return self.is_whole and self.base.startswith("d->")

    @property
    def c_type(self) -> str:
        """C type of the pointer."""
        return f"{'' if self.choices is None else 'const '}{C_TYPES[self.kind]} *"


class CTuple(NamedTuple):
    """Tuple: its members, and the C expression of a struct of numbers if it is one."""

    members: "tuple[CNumber | CArray, ...]"
    text: str = ""

    @property
    def kinds(self) -> str:
        """Kinds of the members."""
        return "".join(member.kind for member in self.members)


class CRecord(NamedTuple):
    """Named tuple of the kernel, whose fields are members of the detector or constants."""

    name: str
    fields: Mapping[str, "CNumber | CArray"]
    is_constant: bool

    @property
    def key(self) -> object:
        """What a function that receives it depends on."""
        return self.name

    @property
    def needs_detector(self) -> bool:
        """Whether a function reaches its fields by the detector."""
        return not self.is_constant


CValue = CNumber | CArray | CTuple | CRecord


def known(value: KnownNumber) -> CNumber:
    """Return a number whose value is known."""
    kind = BOOL if isinstance(value, bool) else INTEGER if isinstance(value, int) else REAL
    return CNumber(kind, "", value)


def widest(*kinds: str) -> str:
    """Return the kind that holds numbers of all these kinds."""
    return max(kinds, key="bird".index)


def literal(value: KnownNumber, *, single: bool) -> str:
    """Return a number as C source.

    Example:
        >>> literal(0.1, single=False), literal(0.1, single=True), literal(-3, single=False)
        ('0.1', '0.1f', '(-3)')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        text = f"INT64_C({value})" if abs(value) >= 1 << 31 else str(value)
    elif math.isnan(value):
        return "HF_NAN"
    elif math.isinf(value):
        text = "HF_INFINITY" if value > 0 else "-HF_INFINITY"
    elif single:
        if 0 < abs(value) < LEAST_SINGLE:
            value = math.copysign(LEAST_SINGLE, value)
        text = str(np.float32(value)) + "f"
    else:
        text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def text_of(value: CNumber, *, single: bool) -> str:
    """Return the C expression of a number."""
    return value.text if value.known is None else literal(value.known, single=single)


def part_of(array: CArray, indices: Sequence[CNumber | slice], *, single: bool) -> CArray:
    """Return the part of an array at some indices; a slice holds the length that is kept."""
    offsets = [*array.offsets]
    shape, strides, choices = [], [], array.choices
    for place, (length, stride) in enumerate(zip(array.shape, array.strides, strict=True)):
        index = indices[place] if place < len(indices) else slice(None)
        if isinstance(index, slice):
            shape.append(length if index.stop is None else _shorter(length, index.stop))
            strides.append(stride)
            choices = _keep_axis(choices, len(shape), shape[-1])
            continue
        if length.known == 1:
            index = known(0)  # there is no other
        if index.known is not None and index.known < 0 and length.known is not None:
            index = known(int(index.known + length.known))
        choices = _take(choices, len(shape), index)
        if index.known is None:
            text = text_of(index, single=single)
            offsets.append(text if stride == 1 else f"{stride} * {text}")
        elif index.known:
            offsets.append(str(int(index.known) * stride))
    return array._replace(
        shape=tuple(shape), strides=tuple(strides), offsets=tuple(offsets), choices=choices
    )


def _shorter(length: CNumber, stop: CNumber) -> CNumber:
    """Return the length of a slice, which ends with its array at the latest."""
    if length.known is None or stop.known is None:
        return stop
    return known(min(int(length.known), int(stop.known)))


def _take(choices: npt.NDArray[Any] | None, n_kept: int, index: CNumber) -> Any:  # noqa: ANN401
    """Return the values that remain possible behind an index."""
    if choices is None:
        return None
    if index.known is not None:
        is_empty = choices.shape[1 + n_kept] == 0  # no element of it is ever read
        return (
            np.empty((0, *np.delete(choices.shape[1:], n_kept)))
            if is_empty
            else choices.take(int(index.known), axis=1 + n_kept)
        )
    moved = np.moveaxis(choices, 1 + n_kept, 1)
    return moved.reshape(moved.shape[0] * moved.shape[1], *moved.shape[2:])


def _keep_axis(choices: npt.NDArray[Any] | None, axis: int, length: CNumber) -> Any:  # noqa: ANN401
    if choices is None or length.known == choices.shape[axis]:
        return choices
    if length.known is None:
        return choices  # of a length that is not known: no element is ever looked at beyond it
    return choices.take(range(int(length.known)), axis=axis)


def element_of(array: CArray) -> CNumber:
    """Return the element of an array without axes that are left, as a number."""
    if array.choices is not None and array.choices.size and _alike(array.choices):
        return known(array.choices.flat[0].item())
    return CNumber(array.kind, f"{array.base}[{' + '.join(array.offsets) or '0'}]")


def _alike(choices: npt.NDArray[Any]) -> bool:
    """Return whether all values have the same bits."""
    return len({value.tobytes() for value in choices.ravel()}) == 1
