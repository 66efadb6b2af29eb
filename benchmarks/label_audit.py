"""Which wrong labels an audit finds: the table of docs/labels.md, as Markdown.

    holdfast simulate twin/reference --seed 0
    python benchmarks/label_audit.py twin/reference --recordings 24

The twin's labels are right. Into them go wrong ones, from seeds 0, 1 and 2: intervals of 0.1 to
1 s get another state, together 2 % or 5 % of the labelled time; or one edge in ten is shifted
by 0.1 to 0.3 s, earlier or later. An interval lies within one label; an edge is shifted where
that leaves both labels at least 0.1 s. Then all recordings are audited.

What is told is right where at least half of it is labelled wrongly; a wrong label is found
where at least half of it is told. Intervals are 95 % by bootstrap over recordings. `first n` is
the precision of as many suspects, weightiest first, as there are wrong labels. Without wrong
labels, all that is told counts as false, though what the twin's hand does by a glitch of its
controller is felt, and not in the labels.
"""

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.contact import ContactState
from holdfast.features import parse_features
from holdfast.io import load_dataset
from holdfast.labelling.review.audit import Suspect, audit
from holdfast.metrics import bootstrap_interval, ratio_of_sums
from holdfast.recordings import Label, Recording
from holdfast.training import Setting

HEADER = (
    "features", "wrong labels", "how many", "told", "precision %", "first n %", "recall %",
    "samples: precision %", "samples: recall %", "seconds an audit",
)  # fmt: skip
STATES = (ContactState.NO_CONTACT, ContactState.UNSTABLE, ContactState.STABLE)
SHORTEST = 0.1

Place = tuple[str, str]
"""Recording and finger."""
Labels = dict[Place, tuple[Label, ...]]


class Wrong(NamedTuple):
    """A stretch that is labelled wrongly."""

    place: Place
    start: float
    end: float


class Outcome(NamedTuple):
    """Of one audit; arrays have one place for each recording.

    `samples` holds (told and wrong, told, wrong).
    """

    n_wrong: np.ndarray
    n_found: np.ndarray
    n_told: np.ndarray
    n_right: np.ndarray
    right_first: float
    samples: np.ndarray
    seconds: float


def main() -> None:
    arguments = parse()
    dataset = load_dataset(arguments.folder)
    step = max(1, len(dataset) // arguments.recordings)
    recordings = [dataset[k] for k in range(0, len(dataset), step)][: arguments.recordings]
    print(f"\n{len(recordings)} recordings, {arguments.seeds} seeds\n")
    print(f"| {' | '.join(HEADER)} |\n|{'---|' * len(HEADER)}", flush=True)
    for features in ("holdfast", "F_tip,F_a,sigma"):
        setting = Setting(trials=0, features=parse_features(features))
        for what, inject in ERRORS.items():
            seeds = range(arguments.seeds if inject else 1)
            outcomes = [one(recordings, setting, inject, seed) for seed in seeds]
            print(f"| {features} | {what} | {' | '.join(figures(outcomes))} |", flush=True)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recordings", type=int, default=24)
    parser.add_argument("--seeds", type=int, default=3)
    return parser.parse_args()


def labels_in(recordings: Sequence[Recording]) -> Labels:
    return {(r.name, f): m.labels for r in recordings for f, m in r.modules.items()}


def changed(
    recordings: Sequence[Recording], rng: np.random.Generator, share: float
) -> tuple[Labels, list[Wrong]]:
    """Intervals with another state, together that share of the labelled time."""
    truth = labels_in(recordings)
    labels, places, wrong = dict(truth), list(truth), list[Wrong]()
    rest = share * sum(each.end - each.start for own in truth.values() for each in own)
    while rest > 0:
        place = places[rng.integers(len(places))]
        own = truth[place]
        middle = rng.uniform(own[0].start, own[-1].end)
        half = rng.uniform(SHORTEST, 1.0) / 2
        label = next((each for each in own if each.start <= middle < each.end), None)
        if label is None:
            continue
        new = Wrong(place, max(label.start, middle - half), min(label.end, middle + half))
        if new.end - new.start < SHORTEST or any(meets(new, other) for other in wrong):
            continue
        state = [each for each in STATES if each is not label.state][rng.integers(2)]
        labels[place] = painted(labels[place], new, state)
        wrong.append(new)
        rest -= new.end - new.start
    return labels, wrong


def shifted(
    recordings: Sequence[Recording], rng: np.random.Generator, share: float
) -> tuple[Labels, list[Wrong]]:
    """That share of the edges, 0.1 to 0.3 s away from their places."""
    labels, wrong = labels_in(recordings), list[Wrong]()
    for place, own in labels.items():
        new = list(own)
        for k in range(len(new) - 1):
            before, after = new[k], new[k + 1]
            chosen, shift = rng.random() < share, rng.uniform(0.1, 0.3) * rng.choice([-1, 1])
            edge, to = before.end, before.end + shift
            if not chosen or before.state is after.state or after.start > edge:
                continue
            if min(to - before.start, after.end - to) < SHORTEST:
                continue
            new[k], new[k + 1] = replace(before, end=to), replace(after, start=to)
            wrong.append(Wrong(place, min(edge, to), max(edge, to)))
        labels[place] = tuple(new)
    return labels, wrong


ERRORS = {
    "none": None,
    "2 % of the time": partial(changed, share=0.02),
    "5 % of the time": partial(changed, share=0.05),
    "1 in 10 edges": partial(shifted, share=0.1),
}


def meets(one: Wrong, other: Wrong) -> bool:
    return one.place == other.place and one.start < other.end and other.start < one.end


def painted(labels: Sequence[Label], wrong: Wrong, state: ContactState) -> tuple[Label, ...]:
    """The labels with that state in place of what they say of the stretch."""
    parts = [Label(wrong.start, wrong.end, state)]
    for label in labels:
        if label.start < wrong.start:
            parts.append(replace(label, end=min(label.end, wrong.start)))
        if label.end > wrong.end:
            parts.append(replace(label, start=max(label.start, wrong.end)))
    return tuple(sorted(parts, key=lambda each: each.start))


def one(recordings: Sequence[Recording], setting: Setting, inject, seed: int) -> Outcome:
    labels, wrong = labels_in(recordings), []
    if inject is not None:
        labels, wrong = inject(recordings, np.random.default_rng(seed))
    given = [r.with_labels({f: labels[r.name, f] for f in r.modules}) for r in recordings]
    began = time.perf_counter()
    told = audit(given, setting).suspects
    return judged(recordings, given, wrong, told, time.perf_counter() - began)


def judged(
    recordings: Sequence[Recording],
    given: Sequence[Recording],
    wrong: Sequence[Wrong],
    told: Sequence[Suspect],
    seconds: float,
) -> Outcome:
    spans = [Wrong((each.recording, each.finger), each.start, each.end) for each in told]
    times = {(r.name, f): m.times for r in recordings for f, m in r.modules.items()}
    is_wrong = {
        (true.name, finger): module.label_states != bad.modules[finger].label_states
        for true, bad in zip(recordings, given, strict=True)
        for finger, module in true.modules.items()
    }
    is_told = {place: np.zeros(len(each), dtype=bool) for place, each in times.items()}
    for span in spans:
        is_told[span.place][within(span, times)] = True
    right = [is_wrong[span.place][within(span, times)].mean() >= 0.5 for span in spans]
    found = [is_told[each.place][within(each, times)].mean() >= 0.5 for each in wrong]
    names = [recording.name for recording in recordings]
    samples = [
        [(is_told[p] & is_wrong[p]).sum(), is_told[p].sum(), is_wrong[p].sum()] for p in times
    ]
    return Outcome(
        n_wrong=counted(wrong, [1] * len(wrong), names),
        n_found=counted(wrong, found, names),
        n_told=counted(spans, [1] * len(spans), names),
        n_right=counted(spans, right, names),
        right_first=float(np.sum(right[: len(wrong)])),
        samples=np.array(samples).sum(axis=0),
        seconds=seconds,
    )


def within(span: Wrong, times: Mapping[Place, np.ndarray]) -> slice:
    first, last = np.searchsorted(times[span.place], (span.start - 1e-6, span.end - 1e-6))
    return slice(first, last)


def counted(spans: Sequence[Wrong], values: Sequence[float], names: Sequence[str]) -> np.ndarray:
    """The sum of the values in each recording."""
    return np.bincount(
        [names.index(span.place[0]) for span in spans], weights=values, minlength=len(names)
    )


def figures(outcomes: Sequence[Outcome]) -> Iterator[str]:
    wrong, found, told, right = (
        np.sum([getattr(each, name) for each in outcomes], axis=0)
        for name in ("n_wrong", "n_found", "n_told", "n_right")
    )
    both, samples_told, samples_wrong = np.sum([each.samples for each in outcomes], axis=0)
    yield f"{wrong.sum():.0f}"
    yield f"{told.sum():.0f}"
    yield share(right, told)
    yield percent(sum(each.right_first for each in outcomes), wrong.sum())
    yield share(found, wrong)
    yield percent(both, samples_told)
    yield percent(both, samples_wrong)
    yield f"{np.mean([each.seconds for each in outcomes]):.0f}"


def share(part: np.ndarray, whole: np.ndarray) -> str:
    """Pooled, with its interval by bootstrap over recordings."""
    ends = bootstrap_interval(ratio_of_sums(100 * part, whole), len(whole))
    if ends is None or not whole.sum():
        return "-"
    low, high = ends
    return f"{percent(part.sum(), whole.sum())} ({low:.0f} to {high:.0f})"


def percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.0f}" if whole else "-"


if __name__ == "__main__":
    main()
