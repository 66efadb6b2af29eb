"""Measure which wrong labels an audit finds: a table of docs/study/labels-by-rules.md, as Markdown.

    holdfast simulate twin/reference --profile finger-reference --seed 0
    python benchmarks/label_audit.py twin/reference --recordings 24

The labels of the twin are correct. Errors are added to them, with the seeds 0, 1 and 2: either
intervals of 0.1 to 1 s get another state, together 2 % or 5 % of the labelled time; or one label
edge in ten is shifted by 0.1 to 0.3 s, earlier or later. Each interval lies within one label. An
edge is shifted only if both labels stay at least 0.1 s long. Then all recordings are audited.

A suspect is correct if at least half of it is labelled wrongly. A wrong label is found if
suspects cover at least half of it. Intervals are 95 % by bootstrap over recordings. `first n` is
the precision of the first n suspects, where n is the number of wrong labels. Without wrong
labels, every suspect counts as false. Some of these are glitches of the twin's hand controller,
which can be felt but are not in the labels.
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
    "features", "errors", "wrong labels", "suspects", "precision %", "first n %", "recall %",
    "precision by sample %", "recall by sample %", "seconds per audit",
)  # fmt: skip
STATES = (ContactState.NO_CONTACT, ContactState.UNSTABLE, ContactState.STABLE)
MIN_DURATION = 0.1
"""Minimum duration of an interval [s]."""

Finger = tuple[str, str]
"""Recording and finger."""
Labels = dict[Finger, tuple[Label, ...]]


class Wrong(NamedTuple):
    """An interval that is labelled wrongly."""

    place: Finger
    start: float
    end: float


class Outcome(NamedTuple):
    """Counts of one audit; arrays have one value for each recording.

    `samples` holds the numbers of samples (suspect and wrong, suspect, wrong).
    """

    n_wrong: np.ndarray
    n_found: np.ndarray
    n_suspects: np.ndarray
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
        for errors, inject in ERRORS.items():
            seeds = range(arguments.seeds if inject else 1)
            outcomes = [one(recordings, setting, inject, seed) for seed in seeds]
            print(f"| {features} | {errors} | {' | '.join(row_cells(outcomes))} |", flush=True)


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


def change_intervals(
    recordings: Sequence[Recording], rng: np.random.Generator, share: float
) -> tuple[Labels, list[Wrong]]:
    """Change the state of random intervals, together `share` of the labelled time."""
    truth = labels_in(recordings)
    labels, places, wrong = dict(truth), list(truth), list[Wrong]()
    rest = share * sum(each.end - each.start for own in truth.values() for each in own)
    while rest > 0:
        place = places[rng.integers(len(places))]
        own = truth[place]
        middle = rng.uniform(own[0].start, own[-1].end)
        half = rng.uniform(MIN_DURATION, 1.0) / 2
        label = next((each for each in own if each.start <= middle < each.end), None)
        if label is None:
            continue
        new = Wrong(place, max(label.start, middle - half), min(label.end, middle + half))
        if new.end - new.start < MIN_DURATION or any(overlaps(new, other) for other in wrong):
            continue
        state = [each for each in STATES if each is not label.state][rng.integers(2)]
        labels[place] = with_state(labels[place], new, state)
        wrong.append(new)
        rest -= new.end - new.start
    return labels, wrong


def shift_edges(
    recordings: Sequence[Recording], rng: np.random.Generator, share: float
) -> tuple[Labels, list[Wrong]]:
    """Shift `share` of the label edges by 0.1 to 0.3 s."""
    labels, wrong = labels_in(recordings), list[Wrong]()
    for place, own in labels.items():
        new = list(own)
        for k in range(len(new) - 1):
            before, after = new[k], new[k + 1]
            chosen, shift = rng.random() < share, rng.uniform(0.1, 0.3) * rng.choice([-1, 1])
            edge, to = before.end, before.end + shift
            if not chosen or before.state is after.state or after.start > edge:
                continue
            if min(to - before.start, after.end - to) < MIN_DURATION:
                continue
            new[k], new[k + 1] = replace(before, end=to), replace(after, start=to)
            wrong.append(Wrong(place, min(edge, to), max(edge, to)))
        labels[place] = tuple(new)
    return labels, wrong


ERRORS = {
    "none": None,
    "2 % of the time": partial(change_intervals, share=0.02),
    "5 % of the time": partial(change_intervals, share=0.05),
    "1 in 10 edges": partial(shift_edges, share=0.1),
}


def overlaps(one: Wrong, other: Wrong) -> bool:
    return one.place == other.place and one.start < other.end and other.start < one.end


def with_state(labels: Sequence[Label], wrong: Wrong, state: ContactState) -> tuple[Label, ...]:
    """Return the labels with another state in an interval."""
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
    labelled = [r.with_labels({f: labels[r.name, f] for f in r.modules}) for r in recordings]
    began = time.perf_counter()
    suspects = audit(labelled, setting).suspects
    return compare(recordings, labelled, wrong, suspects, time.perf_counter() - began)


def compare(
    recordings: Sequence[Recording],
    labelled: Sequence[Recording],
    wrong: Sequence[Wrong],
    suspects: Sequence[Suspect],
    seconds: float,
) -> Outcome:
    spans = [Wrong((each.recording, each.finger), each.start, each.end) for each in suspects]
    times = {(r.name, f): m.times for r in recordings for f, m in r.modules.items()}
    is_wrong = {
        (true.name, finger): module.label_states != bad.modules[finger].label_states
        for true, bad in zip(recordings, labelled, strict=True)
        for finger, module in true.modules.items()
    }
    is_suspect = {place: np.zeros(len(each), dtype=bool) for place, each in times.items()}
    for span in spans:
        is_suspect[span.place][within(span, times)] = True
    right = [is_wrong[span.place][within(span, times)].mean() >= 0.5 for span in spans]
    found = [is_suspect[each.place][within(each, times)].mean() >= 0.5 for each in wrong]
    names = [recording.name for recording in recordings]
    samples = [
        [(is_suspect[p] & is_wrong[p]).sum(), is_suspect[p].sum(), is_wrong[p].sum()] for p in times
    ]
    return Outcome(
        n_wrong=count_by_recording(wrong, [1] * len(wrong), names),
        n_found=count_by_recording(wrong, found, names),
        n_suspects=count_by_recording(spans, [1] * len(spans), names),
        n_right=count_by_recording(spans, right, names),
        right_first=float(np.sum(right[: len(wrong)])),
        samples=np.array(samples).sum(axis=0),
        seconds=seconds,
    )


def within(span: Wrong, times: Mapping[Finger, np.ndarray]) -> slice:
    first, last = np.searchsorted(times[span.place], (span.start - 1e-6, span.end - 1e-6))
    return slice(first, last)


def count_by_recording(
    spans: Sequence[Wrong], values: Sequence[float], names: Sequence[str]
) -> np.ndarray:
    """Return the sum of the values in each recording."""
    return np.bincount(
        [names.index(span.place[0]) for span in spans], weights=values, minlength=len(names)
    )


def row_cells(outcomes: Sequence[Outcome]) -> Iterator[str]:
    wrong, found, suspects, right = (
        np.sum([getattr(each, name) for each in outcomes], axis=0)
        for name in ("n_wrong", "n_found", "n_suspects", "n_right")
    )
    both, samples_suspect, samples_wrong = np.sum([each.samples for each in outcomes], axis=0)
    yield f"{wrong.sum():.0f}"
    yield f"{suspects.sum():.0f}"
    yield share(right, suspects)
    yield percent(sum(each.right_first for each in outcomes), wrong.sum())
    yield share(found, wrong)
    yield percent(both, samples_suspect)
    yield percent(both, samples_wrong)
    yield f"{np.mean([each.seconds for each in outcomes]):.0f}"


def share(part: np.ndarray, whole: np.ndarray) -> str:
    """Return a pooled percentage with its bootstrap interval over recordings."""
    ends = bootstrap_interval(ratio_of_sums(100 * part, whole), len(whole))
    if ends is None or not whole.sum():
        return "-"
    low, high = ends
    return f"{percent(part.sum(), whole.sum())} ({low:.0f} to {high:.0f})"


def percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.0f}" if whole else "-"


if __name__ == "__main__":
    main()
