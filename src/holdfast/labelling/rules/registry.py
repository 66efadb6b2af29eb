"""Rules by name."""

from collections.abc import Callable
from inspect import signature
from typing import Any, NamedTuple

from holdfast.labelling.rules import command, signal, tracking
from holdfast.recordings import Label, Recording

RULES = {
    "signal": "the force alone, as a person reads it off its plot",
    "tracking": "the motion of the object against the fingertips, by their poses",
    "command": "the protocol's markers: closing, locked, disturbance, released",
}
"""What each rule rests on, in one line."""


class _Rule(NamedTuple):
    """How a rule is asked, and the value that holds its limits, where it has some."""

    propose: Callable[..., dict[str, tuple[Label, ...]]]
    limits: type | None = None

    @property
    def arguments(self) -> list[str]:
        return [name for name in list(signature(self.propose).parameters)[1:] if name != "rule"]

    @property
    def limit_names(self) -> list[str]:
        return [] if self.limits is None else list(signature(self.limits).parameters)


_RULES = {
    "signal": _Rule(signal.propose, signal.SignalRule),
    "tracking": _Rule(tracking.propose, tracking.TrackingRule),
    "command": _Rule(command.propose),
}


def propose(
    rule: str,
    recording: Recording,
    **parameters: Any,  # noqa: ANN401 (each rule has its own)
) -> dict[str, tuple[Label, ...]]:
    """Labels by finger that a rule proposes, with its evidence and confidence.

    Args:
        rule: one of `RULES`.
        recording: whose labels are not looked at.
        parameters: arguments of the rule's own `propose`, and its limits: the fields of
            `SignalRule` or `TrackingRule`.

    Raises:
        RecordingError: the recording has not what the rule rests on.
        ValueError: an unknown rule or parameter, or a value that it does not take.
    """
    if rule not in _RULES:
        raise ValueError(f"unknown rule {rule!r}; there are {', '.join(RULES)}")
    asked = _RULES[rule]
    known = [*asked.arguments, *asked.limit_names]
    if unknown := sorted(set(parameters) - set(known)):
        raise ValueError(
            f"rule {rule!r} knows no {', '.join(unknown)}; its parameters are {', '.join(known)}"
        )
    arguments = {name: value for name, value in parameters.items() if name in asked.arguments}
    if asked.limits is not None:
        chosen = {name: value for name, value in parameters.items() if name in asked.limit_names}
        arguments["rule"] = asked.limits(**chosen)
    return asked.propose(recording, **arguments)
