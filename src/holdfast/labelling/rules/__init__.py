"""Rules that propose labels from evidence, for a person to check."""

from collections.abc import Callable
from inspect import signature
from typing import Any, NamedTuple

from holdfast.labelling.rules import command, signal, tracking, video
from holdfast.labelling.rules.video_motion import VideoRule
from holdfast.recordings import Label, Recording

__all__ = ["RULES", "propose"]

RULES = {
    "signal": "the force alone, as a person reads it from its plot",
    "tracking": "the motion of the object relative to the fingertips, from poses or a video",
    "command": "the markers of the protocol: closing, locked, disturbance, released",
}
"""The evidence of each rule, in one line."""


class _Rule(NamedTuple):
    """The function of a rule, and the dataclass of its thresholds, if it has one."""

    propose: Callable[..., dict[str, tuple[Label, ...]]]
    thresholds: type | None = None

    @property
    def arguments(self) -> list[str]:
        # Without the recording, and without the thresholds, whose fields are given one by one.
        return [name for name in list(signature(self.propose).parameters)[1:] if name != "rule"]

    @property
    def threshold_names(self) -> list[str]:
        return [] if self.thresholds is None else list(signature(self.thresholds).parameters)


_RULES = {
    "signal": _Rule(signal.propose, signal.SignalRule),
    "tracking": _Rule(tracking.propose, tracking.TrackingRule),
    "command": _Rule(command.propose),
}
_BY_VIDEO = _Rule(video.propose, VideoRule)


def propose(
    rule: str,
    recording: Recording,
    **parameters: Any,  # noqa: ANN401 (each rule has its own)
) -> dict[str, tuple[Label, ...]]:
    """Return the labels that a rule proposes, by finger, with evidence and confidence.

    Args:
        rule: one of `RULES`.
        recording: the recording. Its labels are ignored.
        parameters: arguments of the function `propose` of the rule, and fields of its `SignalRule`
            or `TrackingRule`. With `video` or `motion`, the rule `tracking` is that of
            `rules/video.py`, with the fields of `VideoRule`.

    Raises:
        RecordingError: the recording lacks what the rule needs.
        ValueError: the rule, a parameter or its value is invalid.
    """
    if rule not in _RULES:
        raise ValueError(f"unknown rule {rule!r}; there are {', '.join(RULES)}")
    by_video = rule == "tracking" and not {"video", "motion"}.isdisjoint(parameters)
    chosen = _BY_VIDEO if by_video else _RULES[rule]
    names = [*chosen.arguments, *chosen.threshold_names]
    if unknown := sorted(set(parameters) - set(names)):
        raise ValueError(
            f"rule {rule!r} has no parameter {', '.join(unknown)}; "
            f"its parameters are {', '.join(names)}"
        )
    arguments = {name: value for name, value in parameters.items() if name in chosen.arguments}
    if chosen.thresholds is not None:
        thresholds = {
            name: parameters[name] for name in chosen.threshold_names if name in parameters
        }
        arguments["rule"] = chosen.thresholds(**thresholds)
    return chosen.propose(recording, **arguments)
