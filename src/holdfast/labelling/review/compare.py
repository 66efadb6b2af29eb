"""How far two labellings of the same recordings agree: two people, or a person and a rule."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from holdfast.contact import ContactState
from holdfast.errors import RecordingError
from holdfast.labelling.review.spans import TIME_TOLERANCE, Span, spans_of
from holdfast.metrics.statistics import quantile
from holdfast.recordings import Label, label_states
from holdfast.sensors.types import Array

MATCHED = 0.5
"""Onsets of two labellings that lie closer than this [s] may be the same."""

TOUCHING = 0.1
"""A label follows on the one before where the gap is at most this [s]: drawn by hand."""

Counts = npt.NDArray[np.int64]


class OnsetDifferences(msgspec.Struct, frozen=True):
    """How far apart two labellings set the onsets of instability.

    Attributes:
        n: onsets that both have.
        only_a: onsets that only A has.
        only_b: onsets that only B has.
        median: of B minus A [s]: above 0 where B is later; None without a common onset.
        p95: 95th percentile of the size of the difference [s].
        values: B minus A of each common onset [s], in order of time.
    """

    n: int
    only_a: int
    only_b: int
    median: float | None
    p95: float | None
    values: list[float]


class FingerAgreement(msgspec.Struct, frozen=True):
    """How far two labellings of one finger, or of several together, agree.

    Attributes:
        kappa: Cohen's, over no contact, unstable and stable; None where it is undefined.
        kappa_stable: Cohen's, over stable and everything else.
        n: samples that both label.
        n_samples: all samples.
        only_a: share of all samples that only A labels, from 0 to 1.
        only_b: share of all samples that only B labels.
        confusion: (3, 3) samples by the state in A (rows) and in B (columns), in the order
            no contact, unstable, stable.
        onset_differences: of not-stable after stable.
        missing_in_a: intervals of B without one of the same state in A that overlaps.
        missing_in_b: intervals of A without one in B.
    """

    kappa: float | None
    kappa_stable: float | None
    n: int
    n_samples: int
    only_a: float
    only_b: float
    confusion: list[list[int]]
    onset_differences: OnsetDifferences
    missing_in_a: list[Span]
    missing_in_b: list[Span]


class RecordingAgreement(msgspec.Struct, frozen=True):
    """How far two labellings of one recording agree, finger by finger."""

    name: str
    fingers: dict[str, FingerAgreement]


class PooledAgreement(msgspec.Struct, frozen=True):
    """As `FingerAgreement`, over all recordings; of missing intervals only how many."""

    kappa: float | None
    kappa_stable: float | None
    n: int
    n_samples: int
    only_a: float
    only_b: float
    confusion: list[list[int]]
    onset_differences: OnsetDifferences
    n_missing_in_a: int
    n_missing_in_b: int


class Agreement(msgspec.Struct, frozen=True):
    """How far two labellings of some recordings agree; `msgspec.json.encode` gives the JSON.

    Attributes:
        recordings: each of them.
        fingers: each finger over all recordings.
        pooled: all fingers and recordings.
    """

    recordings: list[RecordingAgreement]
    fingers: dict[str, PooledAgreement]
    pooled: PooledAgreement


def cohens_kappa(confusion: npt.ArrayLike) -> float | None:
    """Cohen's kappa: agreement beyond that of chance, 1 for perfect and 0 for none.

        kappa = (p_o - p_e) / (1 - p_e)

    p_o is the share of samples with the same state, p_e the share expected of two labellings
    that have nothing to do with each other. Where both give one and the same state to every
    sample p_e is 1, and kappa says nothing: they agree, but so would any two.

    Args:
        confusion: (k, k) samples by the state in A (rows) and in B (columns).

    Returns:
        From -1 to 1; None where p_e is 1, or without samples.

    Example:
        >>> cohens_kappa([[20, 5], [10, 15]])
        0.4
        >>> cohens_kappa([[7, 0], [0, 0]]) is None
        True
    """
    counts = np.asarray(confusion, dtype=np.int64).astype(object)  # whole numbers of any size
    n = int(counts.sum())
    expected = int((counts.sum(axis=0) * counts.sum(axis=1)).sum())
    if n * n == expected:
        return None
    return (n * int(np.trace(counts)) - expected) / (n * n - expected)


def compare(
    a: Mapping[str, Sequence[Label]],
    b: Mapping[str, Sequence[Label]],
    times: Mapping[str, Array],
    name: str = "",
) -> RecordingAgreement:
    """How far two labellings of a recording agree.

    An onset is the start of a label that is not stable and follows on a stable one, with a gap
    of at most 0.1 s. Onsets of A and B are matched one to one where they are at most 0.5 s
    apart: as many as can be, and of all such ways the one with the smallest differences.

    Args:
        a: labels by finger, without overlap.
        b: the same.
        times: by finger of the recording, (n,) of its samples [s].
        name: of the recording.

    Returns:
        The agreement of every finger that A or B labels.

    Raises:
        RecordingError: labels for a finger that the recording does not have.

    Example:
        >>> import numpy as np
        >>> held = Label(0.0, 1.0, ContactState.STABLE), Label(1.0, 2.0, ContactState.UNSTABLE)
        >>> late = Label(0.0, 1.2, ContactState.STABLE), Label(1.2, 2.0, ContactState.UNSTABLE)
        >>> times = np.arange(20) * 0.1
        >>> thumb = compare({"thumb": held}, {"thumb": late}, {"thumb": times}).fingers["thumb"]
        >>> round(thumb.kappa, 6), round(thumb.onset_differences.median, 6)
        (0.8, 0.2)
    """
    labelled = {finger for given in (a, b) for finger, labels in given.items() if labels}
    if unknown := sorted(labelled - set(times)):
        raise RecordingError(
            f"labels for {', '.join(unknown)} given; recording {name!r} has {', '.join(times)}"
        )
    counted = {
        finger: _count(_in_order(a.get(finger, ())), _in_order(b.get(finger, ())), times[finger])
        for finger in times
        if finger in labelled
    }
    return RecordingAgreement(name, {finger: _figures(each) for finger, each in counted.items()})


def pool(recordings: Sequence[RecordingAgreement]) -> Agreement:
    """The agreement over many recordings, by finger and over all.

    Args:
        recordings: from `compare`.
    """
    names = list(dict.fromkeys(finger for each in recordings for finger in each.fingers))
    by_finger = {
        name: [each.fingers[name] for each in recordings if name in each.fingers] for name in names
    }
    return Agreement(
        list(recordings),
        {name: _pooled(parts) for name, parts in by_finger.items()},
        _pooled([part for parts in by_finger.values() for part in parts]),
    )


class _Onsets(NamedTuple):
    values: list[float]
    only_a: int
    only_b: int


@dataclass(frozen=True)
class _Counted:
    """What is counted of one finger."""

    confusion: Counts
    n_samples: int
    n_only_a: int
    n_only_b: int
    onsets: _Onsets
    missing_in_a: list[Span]
    missing_in_b: list[Span]


def _in_order(labels: Sequence[Label]) -> list[Label]:
    return sorted(labels, key=lambda label: label.start)


def _count(a: Sequence[Label], b: Sequence[Label], times: Array) -> _Counted:
    one, two = label_states(a, times), label_states(b, times)
    table = np.bincount(4 * one.astype(np.int64) + two, minlength=16).reshape(4, 4)
    runs_a, runs_b = spans_of(a), spans_of(b)
    return _Counted(
        confusion=table[1:, 1:],
        n_samples=len(times),
        n_only_a=int(table[1:, 0].sum()),
        n_only_b=int(table[0, 1:].sum()),
        onsets=_match(_onsets(a), _onsets(b)),
        missing_in_a=_without_counterpart(runs_b, runs_a),
        missing_in_b=_without_counterpart(runs_a, runs_b),
    )


def _figures(counted: _Counted) -> FingerAgreement:
    n_samples = max(counted.n_samples, 1)
    return FingerAgreement(
        kappa=cohens_kappa(counted.confusion),
        kappa_stable=cohens_kappa(_binary(counted.confusion)),
        n=int(counted.confusion.sum()),
        n_samples=counted.n_samples,
        only_a=counted.n_only_a / n_samples,
        only_b=counted.n_only_b / n_samples,
        confusion=counted.confusion.tolist(),
        onset_differences=_differences(*counted.onsets),
        missing_in_a=counted.missing_in_a,
        missing_in_b=counted.missing_in_b,
    )


def _pooled(parts: Sequence[FingerAgreement]) -> PooledAgreement:
    confusion = sum((np.array(each.confusion) for each in parts), np.zeros((3, 3), dtype=np.int64))
    n_samples = sum(each.n_samples for each in parts)
    onsets = [each.onset_differences for each in parts]
    return PooledAgreement(
        kappa=cohens_kappa(confusion),
        kappa_stable=cohens_kappa(_binary(confusion)),
        n=int(confusion.sum()),
        n_samples=n_samples,
        only_a=sum(each.only_a * each.n_samples for each in parts) / max(n_samples, 1),
        only_b=sum(each.only_b * each.n_samples for each in parts) / max(n_samples, 1),
        confusion=confusion.tolist(),
        onset_differences=_differences(
            [value for each in onsets for value in each.values],
            sum(each.only_a for each in onsets),
            sum(each.only_b for each in onsets),
        ),
        n_missing_in_a=sum(len(each.missing_in_a) for each in parts),
        n_missing_in_b=sum(len(each.missing_in_b) for each in parts),
    )


def _binary(confusion: Counts) -> Counts:
    """(2, 2) everything but stable, and stable."""
    return np.add.reduceat(np.add.reduceat(confusion, [0, 2], axis=0), [0, 2], axis=1)


def _differences(values: list[float], only_a: int, only_b: int) -> OnsetDifferences:
    ordered = np.sort(values)
    return OnsetDifferences(
        n=len(values),
        only_a=only_a,
        only_b=only_b,
        median=quantile(ordered, 0.5),
        p95=quantile(np.sort(np.abs(ordered)), 0.95),
        values=values,
    )


def _onsets(labels: Sequence[Label]) -> Array:
    """When a stable contact ceases to be, by labels in order of time [s]."""
    return np.array(
        [
            after.start
            for before, after in pairwise(labels)
            if before.state is ContactState.STABLE
            and after.state is not ContactState.STABLE
            and after.start - before.end <= TOUCHING + TIME_TOLERANCE
        ],
        dtype=np.float64,
    )


def _match(a: Array, b: Array) -> _Onsets:
    """Onsets one to one: as many as can be, with the smallest differences."""
    differences = b[None, :] - a[:, None]
    near = np.abs(differences) <= MATCHED + TIME_TOLERANCE
    far = (len(a) + len(b) + 1) * (MATCHED + TIME_TOLERANCE)  # dearer than all that match
    rows, columns = linear_sum_assignment(np.where(near, np.abs(differences), far))
    kept = near[rows, columns]
    values = differences[rows[kept], columns[kept]].tolist()
    return _Onsets(values, len(a) - len(values), len(b) - len(values))


def _without_counterpart(runs: Sequence[Span], others: Sequence[Span]) -> list[Span]:
    """The runs that no run of the same state among the others overlaps."""
    return [
        run
        for run in runs
        if not any(
            other.state == run.state and run.overlap(other) > TIME_TOLERANCE for other in others
        )
    ]
