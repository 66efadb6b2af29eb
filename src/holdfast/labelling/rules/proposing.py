"""Rules by name."""

from collections.abc import Callable
from inspect import signature
from typing import Any

from holdfast.labelling.rules import command, signal, tracking
from holdfast.recordings import Label, Recording

RULES = {
    "signal": "the force alone, as a person reads it off its plot",
    "tracking": "the motion of the object against the fingertips, by their poses",
    "command": "the protocol's markers: closing, locked, disturbance, released",
}
"""What each rule rests on, in one line."""

_PROPOSE: dict[str, Callable[..., dict[str, tuple[Label, ...]]]] = {
    "signal": signal.propose,
    "tracking": tracking.propose,
    "command": command.propose,
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
        parameters: of the rule, as its own `propose` takes them.

    Raises:
        RecordingError: the recording has not what the rule rests on.
        ValueError: an unknown rule or parameter.
    """
    if rule not in _PROPOSE:
        raise ValueError(f"unknown rule {rule!r}; there are {', '.join(RULES)}")
    known = list(signature(_PROPOSE[rule]).parameters)[1:]
    if unknown := sorted(set(parameters) - set(known)):
        raise ValueError(
            f"rule {rule!r} knows no {', '.join(unknown)}; its parameters are {', '.join(known)}"
        )
    return _PROPOSE[rule](recording, **parameters)
