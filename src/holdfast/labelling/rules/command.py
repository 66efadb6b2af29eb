"""Labels from the protocol's own markers: closing, locked, disturbance, released.

What a marker says holds until the next one that says something:

| marker | until the next one |
|---|---|
| (before the first, if that is `closing`) | no contact |
| `closing` | unstable, closing |
| `locked`, `disturbance end` | stable |
| `disturbance` | unstable, disturbance |
| `slip` | unstable, slip |
| `lost` | no contact, lost |
| `released` | unstable, released; no contact after `opening` |
| `free` | no contact |

A word that is said again changes nothing. A disturbance is sure where it is said once and its end
is said; otherwise it is doubtful. A finger that does not touch, by its force, has no contact
whatever the marker says; where the force tells nothing of contact (tare `first` or `none`), the
markers alone count.
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
from holdfast.labelling.rules.base import Drawing, Pen
from holdfast.labelling.rules.forces import FingerForce, HandForce, hand_force
from holdfast.metrics.masks import Mask
from holdfast.recordings import Label, Recording

AUTHOR = "rule:command"

WORDS = {
    "closing": ("closing", "close", "closed", "grasp", "grasping"),
    "locked": ("locked", "lock", "stable", "hold", "holding", "held", "rest"),
    "disturbance": ("disturbance", "disturb", "disturbed", "push", "pull", "shake", "perturbation"),
    "slip": ("slip", "slipping", "slipped", "sliding"),
    "lost": ("lost", "dropped", "drop", "fell"),
    "released": ("released", "release", "releasing", "open", "opening", "opened"),
    "free": ("free", "empty", "off"),
}
"""What a marker may say, in any case, anywhere in its text; the first word that is known counts."""
ENDS = ("end", "ended", "over", "stop", "stopped", "done", "finished")
"""A disturbance or slip with one of these words is over: the object is locked again."""

_STATES: dict[str, tuple[int, Cause | None]] = {
    "closing": (UNSTABLE, Cause.CLOSING),
    "locked": (STABLE, None),
    "disturbance": (UNSTABLE, Cause.DISTURBANCE),
    "slip": (UNSTABLE, Cause.SLIP),
    "lost": (NO_CONTACT, Cause.LOST),
    "released": (UNSTABLE, Cause.RELEASED),
    "free": (NO_CONTACT, None),
}
_SURE = 5.0  # times over a threshold that a marker counts as: nine in ten are right
_VAGUE = 1.5  # a disturbance without a word of its end, or with many of its begin


class Order(NamedTuple):
    """What a marker says.

    Attributes:
        time: from when on [s].
        word: one of `WORDS`.
    """

    time: float
    word: str


def propose(
    recording: Recording,
    tare: TareArgument | Tare = 0.5,
    delay: float = 0.0,
    opening: float = 1.0,
) -> dict[str, tuple[Label, ...]]:
    """Labels by finger from the markers of a recording.

    Args:
        recording: with markers, as `holdfast record` keeps them.
        tare: how the baseline is found, by which the force tells contact.
        delay: by which whoever set the markers was late [s].
        opening: how long the hand takes to open [s].

    Raises:
        RecordingError: no marker that says something, or no tare.
        ValueError: an unknown tare.
    """
    orders = [Order(order.time - delay, order.word) for order in orders_of(recording)]
    if not orders:
        raise RecordingError(
            f"recording {recording.name!r} has no marker of the protocol: one of "
            f"{', '.join(WORDS)} expected, it has {_shown(recording)}"
        )
    hand = hand_force(recording, tare)
    pen = Pen(AUTHOR, _evidence)
    return {
        name: pen.labels(_drawing(finger, hand, orders, opening), finger.span)
        for name, finger in hand.fingers.items()
    }


def orders_of(recording: Recording) -> list[Order]:
    """The markers that say something, in order of time; all others are passed over."""
    found = ((time, word_of(text)) for time, text in sorted(recording.markers))
    return [Order(time, word) for time, word in found if word]


def word_of(text: str) -> str | None:
    """What a marker says, as one of `WORDS`; None for any other text.

    Example:
        >>> word_of("Hand CLOSING now"), word_of("end of disturbance"), word_of("mark 3")
        ('closing', 'locked', None)
    """
    words = re.findall(r"[a-z]+", text.lower())
    if "contact" in words and "no" in words:
        return "free"
    known = {given: word for word, every in WORDS.items() for given in every}
    word = next((known[given] for given in words if given in known), None)
    if word in ("disturbance", "slip") and any(end in words for end in ENDS):
        return "locked"
    return word


def _drawing(finger: FingerForce, hand: HandForce, orders: list[Order], opening: float) -> Drawing:
    drawing = Drawing.blank(hand.times)
    times, known = hand.times, finger.known
    if orders[0].word == "closing":
        drawing.paint(known & (times < orders[0].time), NO_CONTACT, None, _SURE)
    for one, end, ratio in _spans(orders):
        state, cause = _STATES[one.word]
        inside = known & (times >= one.time) & (times < end)
        drawing.paint(inside, state, cause, ratio)
        if one.word == "released":
            drawing.paint(inside & (times >= one.time + opening), NO_CONTACT, None, ratio)
    if finger.threshold is not None:
        _correct(drawing, finger, times >= orders[0].time)
    return drawing


def _spans(orders: list[Order]) -> Iterator[tuple[Order, float, float]]:
    """Each order that is not the one before again, until when it holds, and how sure it is."""
    runs = [list(run) for _, run in groupby(orders, key=lambda order: order.word)]
    for run, following in pairwise([*runs, [Order(np.inf, "")]]):
        ended = len(run) == 1 and following[0].word in ("locked", "lost")
        vague = run[0].word == "disturbance" and not ended
        yield run[0], following[0].time, _VAGUE if vague else _SURE


def _correct(drawing: Drawing, finger: FingerForce, told: Mask) -> None:
    """Lets the force have its say: no contact where there is none, doubt where there is some."""
    untouched = told & ~finger.contact & np.isin(drawing.codes, (STABLE, UNSTABLE))
    drawing.paint(untouched, NO_CONTACT, None, _SURE)
    drawing.ratio[finger.contact & (drawing.codes == NO_CONTACT)] = 1.0


def _evidence(state: ContactState, cause: Cause | None, ratio: float) -> str:
    word = cause or ("locked" if state is ContactState.STABLE else "free, or no force")
    return f"marker: {word}" if ratio > 1 else f"marker: {word}; the force speaks against it"


def _shown(recording: Recording) -> str:
    texts = list(dict.fromkeys(text for _, text in recording.markers))
    shown = ", ".join(repr(text[:40]) for text in texts[:6])
    return (shown + (f" and {len(texts) - 6} more" if len(texts) > 6 else "")) or "none"
