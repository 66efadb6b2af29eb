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
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE, Cause, ContactState
from holdfast.detection import Tare
from holdfast.detection.plan import TareArgument
from holdfast.errors import RecordingError
from holdfast.labelling.rules.base import LabelWriter, StateTimeline
from holdfast.labelling.rules.forces import FingerForce, HandForce, hand_force
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
    words = ((time, command_word(text)) for time, text in sorted(recording.markers))
    commands = [ProtocolMarker(time - delay, word) for time, word in words if word]
    if not commands:
        texts = list(dict.fromkeys(text for _, text in recording.markers))
        shown = ", ".join(repr(text[:40]) for text in texts[:6])
        shown += f" and {len(texts) - 6} more" if len(texts) > 6 else ""
        raise RecordingError(
            f"recording {recording.name!r} has no marker of the protocol: one of "
            f"{', '.join(WORDS)} expected, it has {shown or 'none'}"
        )
    hand = hand_force(recording, tare)
    writer = LabelWriter(COMMAND_RULE, _evidence)
    return {
        name: writer.labels(_timeline(finger, hand, commands, opening), finger.span)
        for name, finger in hand.fingers.items()
    }


def command_word(text: str) -> str | None:
    """Return the command in the text of a marker, as a key of `WORDS`; None if there is none.

    Example:
        >>> command_word("Hand CLOSING now"), command_word("end of disturbance")
        ('closing', 'locked')
        >>> command_word("mark 3") is None
        True
    """
    words = re.findall(r"[a-z]+", text.lower())
    if "contact" in words and "no" in words:  # two words, of which neither is a synonym alone
        return "free"
    word_of_synonym = {synonym: word for word, synonyms in WORDS.items() for synonym in synonyms}
    word = next(
        (word_of_synonym[text_word] for text_word in words if text_word in word_of_synonym), None
    )
    if word in ("disturbance", "slip") and any(end in words for end in END_WORDS):
        return "locked"
    return word


def _timeline(
    finger: FingerForce, hand: HandForce, commands: list[ProtocolMarker], opening: float
) -> StateTimeline:
    timeline = StateTimeline.unknown(hand.times)
    times, has_force = hand.times, finger.known
    if commands[0].word == "closing":
        timeline.set_state(has_force & (times < commands[0].time), NO_CONTACT, None, CLEAR_RATIO)
    groups = [list(group) for _, group in groupby(commands, key=lambda command: command.word)]
    for group, following in pairwise([*groups, [ProtocolMarker(np.inf, "")]]):
        # A repeated marker changes nothing, but a person who begins a push twice has forgotten to
        # end one: what lies between is less certain.
        command, end = group[0], following[0].time
        # `disturbance end` is read as `locked`; a push may also lose the object.
        ended = len(group) == 1 and following[0].word in ("locked", "lost")
        open_ended = command.word == "disturbance" and not ended
        ratio = OPEN_ENDED_RATIO if open_ended else CLEAR_RATIO
        state, cause = _STATE_OF_WORD[command.word]
        inside = has_force & (times >= command.time) & (times < end)
        timeline.set_state(inside, state, cause, ratio)
        if command.word == "released":
            timeline.set_state(inside & (times >= command.time + opening), NO_CONTACT, None, ratio)
    if finger.threshold is not None:
        # Not every finger takes part in every grasp: a force without contact counts more than the
        # marker. Where it shows contact against the marker, the label is only in doubt: a baseline
        # may have drifted.
        held = np.isin(timeline.codes, (STABLE, UNSTABLE))
        free = (times >= commands[0].time) & ~finger.contact & held
        timeline.set_state(free, NO_CONTACT, None, CLEAR_RATIO)
        timeline.ratio[finger.contact & (timeline.codes == NO_CONTACT)] = 1.0
    return timeline


def _evidence(state: ContactState, cause: Cause | None, ratio: float) -> str:
    word = cause or ("locked" if state is ContactState.STABLE else "free, or no force")
    return f"marker: {word}" if ratio > 1 else f"marker: {word}; the force contradicts it"
