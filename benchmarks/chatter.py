"""Count changes of the hand's state in quiet holds, and what steady decisions cost in delay.

    holdfast study --twin --out study            # or: holdfast simulate study/data/main
    python benchmarks/chatter.py training=study/data/main unseen=study/data/others
    python benchmarks/chatter.py real=recordings --models builtin:any my-hand.json

A quiet hold is a hold in which the hand is stable by the truth, or by the labels of a recording
without truth, from 1 s after its beginning to its end. `raw` are the decisions of `detect --raw`:
without hold time, hysteresis of the probability and minimum duration. Delays are those of the
events of the hand, a missed event counting as infinite.
"""

import argparse
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.contact import STABLE
from holdfast.io import load_dataset
from holdfast.metrics import FingerDecisions
from holdfast.metrics.events import AlarmMatch, EventMetrics, match_decisions, pool_events
from holdfast.metrics.masks import runs
from holdfast.model import Debounce, Model
from holdfast.recordings import Recording
from holdfast.training.evaluation import compute_decisions

SETTLED = 1.0
"""Time from the beginning of a hold after which it is quiet [s]."""
HEADS = (
    "model", "recordings", "decisions", "quiet min", "changes/min", "changes in a recording",
    "events", "median delay ms", "95 % ms", "missed at 0.05, 0.1, 0.2 s %", "false alarms/min",
)  # fmt: skip


class Count(NamedTuple):
    """Changes of the hand's state in one recording.

    Attributes:
        quiet_seconds: duration of quiet holds [s].
        quiet: number of changes in them.
        whole: number of changes in the whole recording.
    """

    quiet_seconds: float
    quiet: int
    whole: int


def main(arguments: argparse.Namespace) -> None:
    print("| " + " | ".join(HEADS) + " |\n" + "|---" * len(HEADS) + "|")
    for name in arguments.models:
        model = Model.load(name)
        for pair in arguments.data:
            label, _, folder = pair.rpartition("=")
            for kind, used in (("raw", raw(model)), ("steady", model)):
                hands = [hand_of(used, each) for each in load_dataset(folder)]
                print(row([name, label or folder, kind], hands), flush=True)


def raw(model: Model) -> Model:
    """Return the model without debouncing."""
    return msgspec.structs.replace(model, debounce=Debounce())


def hand_of(model: Model, recording: Recording) -> FingerDecisions:
    """Return the decisions about the hand."""
    hand = compute_decisions(model, recording).hand
    if hand is None:
        raise SystemExit(f"{recording.name}: no decisions about the hand")
    return hand


def row(names: Sequence[str], hands: Sequence[FingerDecisions]) -> str:
    """Return a line of the table for the decisions about several recordings."""
    counts = [count(hand) for hand in hands]
    minutes = sum(each.quiet_seconds for each in counts) / 60
    events = pool_events([alarms(hand) for hand in hands])
    cells = (
        *names,
        f"{minutes:.1f}",
        f"{sum(each.quiet for each in counts) / minutes:.1f}" if minutes else "",
        f"{np.mean([each.whole for each in counts]):.0f}",
        *delays(events),
    )
    return f"| {' | '.join(cells)} |"


def delays(events: EventMetrics) -> tuple[str, ...]:
    """Return the cells of events, their delay, missed ones and false alarms."""

    def shown(value: float | None, scale: float, digits: int) -> str:
        return "" if value is None else f"{value * scale:.{digits}f}"

    return (
        str(events.n_events),
        shown(events.delay_median, 1000, 0) or ("inf" if events.n_events else ""),
        shown(events.delay_p95, 1000, 0) or ("inf" if events.n_events else ""),
        ", ".join(shown(each, 1, 1) for each in events.missed.values()),
        shown(events.false_alarms_per_minute, 1, 1),
    )


def alarms(hand: FingerDecisions) -> AlarmMatch:
    """Return the events and alarms of the hand; none without labels."""
    return match_decisions(hand) if hand.labels.any() else AlarmMatch((), (), 0.0)


def count(hand: FingerDecisions) -> Count:
    """Count the changes of the hand's state, in quiet holds and in all."""
    labels = hand.labels if hand.exact_labels is None else hand.exact_labels
    changed = np.diff(hand.states, prepend=hand.states[:1]) != 0
    quiet = np.zeros(len(hand.times), dtype=bool)
    seconds = 0.0
    for first, end in runs(labels == STABLE):
        start = int(np.searchsorted(hand.times, hand.times[first] + SETTLED))
        if start < end:
            quiet[start + 1 : end] = True
            seconds += float(hand.times[end - 1] - hand.times[start])
    return Count(seconds, int((changed & quiet).sum()), int(changed.sum()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("data", nargs="+", metavar="LABEL=FOLDER", help="folders of recordings")
    parser.add_argument("--models", nargs="+", default=["builtin:twin", "builtin:any"])
    main(parser.parse_args())
