"""Documents with the fields of the values that they publish: a field is defined only once."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, get_args, get_origin

import msgspec
from msgspec import Struct
from msgspec.structs import astuple, fields, replace

from holdfast.contact import ContactEstimate
from holdfast.sensors import taxel_numbers

Number = float | None
"""A number, or null if there is none (NaN and infinity are written as null)."""
Vector = tuple[float, float, float]


def document_type(
    name: str,
    value: type[Struct],
    description: str,
    *,
    nullable: Callable[[str], bool] = lambda _: False,
    added: Sequence[tuple[Any, ...]] = (),
    at: int | None = None,
) -> type[Any]:
    """Return a type of documents with the fields of a type of values, in the same order.

    A document has every field, so no field of the value is optional in it.

    Args:
        name: of the type.
        value: type of the values.
        description: for the JSON Schema.
        nullable: whether the numbers of the field with a name may be null, because they may be
            NaN or infinite in the value.
        added: fields that only the document has: name, type and perhaps the default.
        at: position of the added fields; None for the end.

    Example:
        >>> class Weight(Struct):
        ...     mass: float = 0.0
        >>> document_type("Labelled", Weight, "", added=[("label", str)])(1.5, "box")
        Labelled(mass=1.5, label='box')
    """
    renamed_fields: list[tuple[Any, ...]] = [
        (field.name, _nullable(field.type) if nullable(field.name) else field.type)
        for field in fields(value)
    ]
    index = len(renamed_fields) if at is None else at
    return msgspec.defstruct(
        name,
        [*renamed_fields[:index], *added, *renamed_fields[index:]],
        namespace={"__doc__": description},
        module=__name__,
        frozen=True,
        gc=False,
    )


def _nullable(kind: Any) -> Any:  # noqa: ANN401 (a type, or a form of typing)
    """Return a type whose numbers may be null."""
    if get_origin(kind) is tuple:
        return tuple[tuple(map(_nullable, get_args(kind)))]  # type: ignore[misc]
    return Number if kind is float else kind


# Type checkers do not see the fields of a class that is made at run time, so they get one by hand.
if TYPE_CHECKING:

    class FingerDocument(ContactEstimate, frozen=True):
        """Estimate of a finger, see below."""

        taxels: list[Vector] | None = None

else:
    FingerDocument = document_type(
        "FingerDocument",
        ContactEstimate,
        """Newest estimate of a finger: see `holdfast.ContactEstimate`.

    Attributes:
        faulty_taxels: numbers of the taxels that are faulty by themselves, from 1.
        taxels: readings minus the tare, in taxel frames [unit]; null before the tare.
    """,
        nullable=lambda name: name != "time",
        added=[("taxels", list[Vector] | None, None)],
    )

EstimateLine = document_type(
    "EstimateLine",
    ContactEstimate,
    "JSON line: the estimate of a finger at a sample. Taxels are numbers, from 1.",
    nullable=lambda name: name != "time",
    added=[("finger", str)],
    at=1,  # after the time
)


def numbered(estimate: ContactEstimate) -> ContactEstimate:
    """Return the estimate as documents have it: with the numbers of faulty taxels, from 1."""
    if not estimate.faulty_taxels:
        return estimate
    return replace(estimate, faulty_taxels=taxel_numbers(estimate.faulty_taxels))


def finger_document(
    estimate: ContactEstimate, taxels: list[Vector] | None = None
) -> FingerDocument:
    """Return the estimate of a finger as a document."""
    values = (*astuple(numbered(estimate)), taxels)
    return FingerDocument(*values)


def estimate_line(finger: str, estimate: ContactEstimate) -> Any:  # noqa: ANN401 (made at run time)
    """Return the estimate of a finger as a JSON line."""
    values = astuple(numbered(estimate))
    return EstimateLine(values[0], finger, *values[1:])
