"""Labels from the markers of the protocol: closing, locked, disturbance, released.

A marker with a known word applies until the next one:

| marker | label |
|---|---|
| (before the first, if that is `closing`) | no contact |
| `closing` | unstable, closing |
| `locked`, `disturbance end` | stable |
| `disturbance` | unstable, disturbance |
| `slip` | unstable, slip |
| `lost` | no contact, lost |
| `released` | unstable, released; no contact after `opening` |
| `free` | no contact |

A repeated marker changes nothing. A disturbance has a high confidence only if one marker begins it
and one ends it. A finger without contact by its force is labelled no contact, whatever the markers
are. If no contact threshold is known (tare `first` or `none`), only the markers count.
"""

import re
from collections.abc import Iterator
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE, Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.features import Tare
from holdfast.features.tare import TareArgument
from holdfast.labelling.rules.base import LabelWriter, StateTimeline
from holdfast.labelling.rules.forces import FingerForce, HandForce, hand_force
from holdfast.metrics.masks import Mask
from holdfast.recordings import Label, Recording

COMMAND_RULE = "rule:command"

WORDS = {
    "closing": ("closing", "close", "closed", "grasp", "grasping"),
    "locked": ("locked", "lock", "stable", "hold", "holding", "held", "rest"),
    "disturbance": ("disturbance", "disturb", "disturbed", "push", "pull", "shake", "perturbation"),
    "slip": ("slip", "slipping", "slipped", "sliding"),
    "lost": ("lost", "dropped", "drop", "fell"),
    "released": ("released", "release", "releasing", "open", "opening", "opened"),
    "free": ("free", "empty", "off"),
}
"""Synonyms of each command in a marker, in any case and position. The first known word counts."""
END_WORDS = ("end", "ended", "over", "stop", "stopped", "done", "finished")
"""Words that end a disturbance or slip: the object is locked again."""
CLEAR_RATIO = 5.0
"""Evidence ratio of a marker: nine in ten are right."""
OPEN_ENDED_RATIO = 1.5
"""Evidence ratio of a disturbance without an end, or with repeated beginnings."""

_STATE_OF_WORD: dict[str, tuple[int, Cause | None]] = {
    "closing": (UNSTABLE, Cause.CLOSING),
    "locked": (STABLE, None),
    "disturbance": (UNSTABLE, Cause.DISTURBANCE),
    "slip": (UNSTABLE, Cause.SLIP),
    "lost": (NO_CONTACT, Cause.LOST),
    "released": (UNSTABLE, Cause.RELEASED),
    "free": (NO_CONTACT, None),
}


class ProtocolMarker(NamedTuple):
    """A marker of the protocol.

    Attributes:
        time: when it begins to apply [s].
        word: a key of `WORDS`.
    """

    time: float
    word: str


def propose(
    recording: Recording,
    tare: TareArgument | Tare | None = None,
    delay: float = 0.0,
    opening: float = 1.0,
) -> dict[str, tuple[Label, ...]]:
    """Return labels by finger from the markers of a recording.

    Args:
        recording: with markers, as `holdfast record` writes them.
        tare: how the baseline is found, by default as `fitting_tare` chooses; the force decides
            on contact.
        delay: of the person who set the markers [s].
        opening: time that the hand takes to open [s].

    Raises:
        RecordingError: no marker has a known word, or no sample for the tare.
        ValueError: the tare is unknown.
    """
    commands = [
        ProtocolMarker(protocol_marker.time - delay, protocol_marker.word)
        for protocol_marker in protocol_markers(recording)
    ]
    if not commands:
        raise RecordingError(
            f"recording {recording.name!r} has no marker of the protocol: one of "
            f"{', '.join(WORDS)} expected, it has {_shown(recording)}"
        )
    hand = hand_force(recording, tare)
    writer = LabelWriter(COMMAND_RULE, _evidence)
    return {
        name: writer.labels(_timeline(finger, hand, commands, opening), finger.span)
        for name, finger in hand.fingers.items()
    }


def protocol_markers(recording: Recording) -> list[ProtocolMarker]:
    """Return the markers with a known word in order of time; others are ignored."""
    words = ((time, command_word(text)) for time, text in sorted(recording.markers))
    return [ProtocolMarker(time, word) for time, word in words if word]


def command_word(text: str) -> str | None:
    """Return the command in the text of a marker, as a key of `WORDS`; None if there is none.

    Example:
        >>> command_word("Hand CLOSING now"), command_word("end of disturbance")
        ('closing', 'locked')
        >>> command_word("mark 3") is None
        True
    """
    words = re.findall(r"[a-z]+", text.lower())
    if "contact" in words and "no" in words:
        return "free"
    known = {synonym: word for word, synonyms in WORDS.items() for synonym in synonyms}
    word = next((known[text_word] for text_word in words if text_word in known), None)
    if word in ("disturbance", "slip") and any(end in words for end in END_WORDS):
        return "locked"
    return word


def _timeline(
    finger: FingerForce, hand: HandForce, commands: list[ProtocolMarker], opening: float
) -> StateTimeline:
    timeline = StateTimeline.unknown(hand.times)
    times, known = hand.times, finger.known
    if commands[0].word == "closing":
        timeline.set_state(known & (times < commands[0].time), NO_CONTACT, None, CLEAR_RATIO)
    for command, end, ratio in _spans(commands):
        state, cause = _STATE_OF_WORD[command.word]
        inside = known & (times >= command.time) & (times < end)
        timeline.set_state(inside, state, cause, ratio)
        if command.word == "released":
            timeline.set_state(inside & (times >= command.time + opening), NO_CONTACT, None, ratio)
    if finger.threshold is not None:
        _correct_by_force(timeline, finger, times >= commands[0].time)
    return timeline


def _spans(commands: list[ProtocolMarker]) -> Iterator[tuple[ProtocolMarker, float, float]]:
    """Yield each command that is not a repetition, its end [s], and its evidence ratio."""
    groups = [list(group) for _, group in groupby(commands, key=lambda command: command.word)]
    for group, following in pairwise([*groups, [ProtocolMarker(np.inf, "")]]):
        ended = len(group) == 1 and following[0].word in ("locked", "lost")
        open_ended = group[0].word == "disturbance" and not ended
        yield group[0], following[0].time, OPEN_ENDED_RATIO if open_ended else CLEAR_RATIO


def _correct_by_force(timeline: StateTimeline, finger: FingerForce, commanded: Mask) -> None:
    """Label no contact where the force shows none; lower the confidence where it shows contact."""
    held = np.isin(timeline.codes, (STABLE, UNSTABLE))
    timeline.set_state(commanded & ~finger.contact & held, NO_CONTACT, None, CLEAR_RATIO)
    timeline.ratio[finger.contact & (timeline.codes == NO_CONTACT)] = 1.0


def _evidence(state: ContactState, cause: Cause | None, ratio: float) -> str:
    word = cause or ("locked" if state is ContactState.STABLE else "free, or no force")
    return f"marker: {word}" if ratio > 1 else f"marker: {word}; the force contradicts it"


def _shown(recording: Recording) -> str:
    """Return the first distinct marker texts."""
    texts = list(dict.fromkeys(text for _, text in recording.markers))
    shown = ", ".join(repr(text[:40]) for text in texts[:6])
    return (shown + (f" and {len(texts) - 6} more" if len(texts) > 6 else "")) or "none"
