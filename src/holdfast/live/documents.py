"""Documents with the fields of the values that they publish: a field is defined only once."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, get_args, get_origin

import msgspec
from msgspec import Struct
from msgspec.structs import astuple, fields, replace

from holdfast.contact import ContactEstimate
from holdfast.grip.command import FingerCommand, GripReason, LoopState
from holdfast.grip.limits import Limits
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
    own: list[tuple[Any, ...]] = [
        (field.name, _nullable(field.type) if nullable(field.name) else field.type)
        for field in fields(value)
    ]
    place = len(own) if at is None else at
    return msgspec.defstruct(
        name,
        [*own[:place], *added, *own[place:]],
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
    at=1,
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


if TYPE_CHECKING:
    GripLimits = Limits

    class GripFinger(FingerCommand, frozen=True, kw_only=True):
        """Command of a finger, see below."""

        highest: float

else:
    GripLimits = document_type(
        "GripLimits",
        Limits,
        "Limits of the controller, see `holdfast.grip.Limits`; null for no limit.",
        nullable=lambda name: name == "recovery",
    )
    GripFinger = document_type(
        "GripFinger",
        FingerCommand,
        """Newest command of a finger.

    Attributes:
        scale: force as a multiple of that when the grip began.
        highest: highest scale that this finger may get.
        reason: why the force rises or falls; empty where it stays.
    """,
        added=[("highest", float)],
        at=1,
    )


class GripEntry(Struct, frozen=True, gc=False):
    """Event of the loop; time on the clock of the source [s]."""

    time: Number
    text: str


class GripFault(Struct, frozen=True, kw_only=True, gc=False):
    """Explanation of a fault for a person, see `holdfast.live.loop.grip_faults`.

    Attributes:
        reason: of the fault; "ended" if the loop has ended for good.
        happened: what happened, and what it means.
        commanded: what the hand is commanded now.
        continues: what goes on without a reset.
        reset: what a reset does.
    """

    reason: str
    happened: str
    commanded: str
    continues: str
    reset: str


class GripDocument(Struct, frozen=True, kw_only=True, gc=False):
    """State and newest command of the loop.

    Attributes:
        hand: URI of the hand.
        law: name of the law of grip force.
        armed: whether commands are sent; otherwise it is a dry run.
        limits: of the controller.
        state: IDLE, HOLD, REACT, RELAX or FAULT.
        reason: why the state is FAULT; empty otherwise.
        stopped: whether the loop was stopped, and not reset after it.
        released: whether the hand is commanded to be open.
        time: of the newest command, on the clock of the source [s]; null before the first.
        fingers: newest command of each finger.
        n_sent: number of commands that were sent.
        failure: why the loop has ended for good; empty while it runs.
        events: newest events, oldest first.
        fault: explanation of the fault; null if there is none.
        waiting: what the hand lacks before the grip begins; empty from when it has begun.
    """

    hand: str
    law: str
    armed: bool
    limits: GripLimits
    state: LoopState
    reason: GripReason
    stopped: bool
    released: bool
    time: Number
    fingers: dict[str, GripFinger]
    n_sent: int
    failure: str
    events: list[GripEntry]
    fault: GripFault | None = None
    waiting: str = ""
