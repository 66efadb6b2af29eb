"""Agreement of two sets of labels of the same recordings: by two people, or a person and a rule."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import TIME_TOLERANCE, Cause, ContactState
from holdfast.detector.detection import CAUSE_BY_CODE
from holdfast.errors import RecordingError
from holdfast.labelling.review.spans import Span, spans_of
from holdfast.metrics.statistics import quantile
from holdfast.recordings import Label, label_states
from holdfast.sensors.types import Array

MAX_ONSET_DIFFERENCE = 0.5
"""Largest time between two onsets that may be the same [s]."""

MAX_LABEL_GAP = 0.1
"""Largest gap between two labels that follow each other; people draw small gaps [s]."""

Confusion = npt.NDArray[np.int64]
NO_CAUSES: Confusion = np.zeros((len(Cause), len(Cause)), dtype=np.int64)


class OnsetDifferences(msgspec.Struct, frozen=True):
    """Differences between the onsets of instability in A and in B.

    Attributes:
        n: number of onsets in both.
        only_a: number of onsets only in A.
        only_b: number of onsets only in B.
        median: of B minus A [s], above 0 if B is later; None without a common onset.
        p95: 95th percentile of the absolute difference [s].
        values: B minus A of each common onset [s], in order of time.
    """

    n: int
    only_a: int
    only_b: int
    median: float | None
    p95: float | None
    values: list[float]


class AgreementNumbers(msgspec.Struct, frozen=True):
    """Numbers of the agreement of A and B, on one finger or over several.

    Attributes:
        kappa: Cohen's kappa of no contact, unstable and stable; None if it is undefined.
        kappa_stable: Cohen's kappa of stable against the other two.
        n: number of samples that both label.
        n_samples: number of all samples.
        only_a: share of all samples that only A labels, from 0 to 1.
        only_b: share of all samples that only B labels.
        confusion: (3, 3) number of samples by the state in A (rows) and in B (columns), in the
            order no contact, unstable, stable.
        onset_differences: of changes from stable to another state.
        causes: (6, 6) number of samples for which both give a cause, by that in A (rows) and in B
            (columns), in the order of `holdfast.Cause`.
        kappa_cause: Cohen's kappa of those causes; None if it is undefined.
    """

    kappa: float | None
    kappa_stable: float | None
    n: int
    n_samples: int
    only_a: float
    only_b: float
    confusion: list[list[int]]
    onset_differences: OnsetDifferences
    causes: list[list[int]]
    kappa_cause: float | None


class FingerAgreement(AgreementNumbers, frozen=True):
    """Agreement of A and B on one finger of one recording.

    Attributes:
        missing_in_a: intervals of B that no interval of the same state in A overlaps.
        missing_in_b: intervals of A that no interval of the same state in B overlaps.
    """

    missing_in_a: list[Span]
    missing_in_b: list[Span]


class RecordingAgreement(msgspec.Struct, frozen=True):
    """Agreement of A and B on each finger of one recording."""

    name: str
    fingers: dict[str, FingerAgreement]


class PooledAgreement(AgreementNumbers, frozen=True):
    """Agreement over recordings; missing intervals are only counted."""

    n_missing_in_a: int
    n_missing_in_b: int


class Agreement(msgspec.Struct, frozen=True):
    """Agreement of A and B on recordings; `msgspec.json.encode` gives the JSON.

    Attributes:
        recordings: agreement on each recording.
        fingers: agreement on each finger over all recordings.
        pooled: agreement over all fingers and recordings.
    """

    recordings: list[RecordingAgreement]
    fingers: dict[str, PooledAgreement]
    pooled: PooledAgreement


def cohens_kappa(confusion: npt.ArrayLike) -> float | None:
    """Return Cohen's kappa: agreement beyond chance, 1 if perfect and 0 if by chance.

        kappa = (p_o - p_e) / (1 - p_e)

    p_o is the share of samples with the same state, p_e the share that independent labels with the
    same frequencies of states would have. If A and B give one state to all samples, p_e is 1 and
    kappa is undefined.

    Args:
        confusion: (k, k) number of samples by the state in A (rows) and in B (columns).

    Returns:
        From -1 to 1; None if p_e is 1, or without samples.

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
    """Compare two sets of labels of a recording.

    An onset is the start of a label that is not stable and follows a stable one, with a gap of at
    most 0.1 s. Onsets of A and B at most 0.5 s apart are matched one to one: as many as possible,
    with the smallest sum of differences.

    Args:
        a: labels by finger, without overlap.
        b: labels by finger, without overlap.
        times: by finger of the recording, (n,) of its samples [s].
        name: of the recording.

    Returns:
        The agreement on every finger that A or B labels.

    Raises:
        RecordingError: the recording has no such finger.

    Example:
        >>> import numpy as np
        >>> held = Label(0.0, 1.0, ContactState.STABLE), Label(1.0, 2.0, ContactState.UNSTABLE)
        >>> late = Label(0.0, 1.2, ContactState.STABLE), Label(1.2, 2.0, ContactState.UNSTABLE)
        >>> times = np.arange(20) * 0.1
        >>> thumb = compare({"thumb": held}, {"thumb": late}, {"thumb": times}).fingers["thumb"]
        >>> round(thumb.kappa, 6), round(thumb.onset_differences.median, 6)
        (0.8, 0.2)
    """
    labelled = {finger for by_finger in (a, b) for finger, labels in by_finger.items() if labels}
    if unknown := sorted(labelled - set(times)):
        raise RecordingError(
            f"labels for {', '.join(unknown)} given; recording {name!r} has {', '.join(times)}"
        )
    fingers = {}
    for finger in (finger for finger in times if finger in labelled):
        in_a, in_b = (sorted(of.get(finger, ()), key=lambda label: label.start) for of in (a, b))
        fingers[finger] = _agreement(in_a, in_b, times[finger])
    return RecordingAgreement(name, fingers)


def pool(recordings: Sequence[RecordingAgreement]) -> Agreement:
    """Return the agreement over recordings, by finger and over all fingers.

    Args:
        recordings: from `compare`.
    """
    names = list(dict.fromkeys(finger for recording in recordings for finger in recording.fingers))
    by_finger = {
        name: [recording.fingers[name] for recording in recordings if name in recording.fingers]
        for name in names
    }
    return Agreement(
        list(recordings),
        {name: _pooled(parts) for name, parts in by_finger.items()},
        _pooled([part for parts in by_finger.values() for part in parts]),
    )


def _agreement(a: Sequence[Label], b: Sequence[Label], times: Array) -> FingerAgreement:
    from scipy.optimize import linear_sum_assignment

    codes_a, codes_b = label_states(a, times), label_states(b, times)
    table = np.bincount(4 * codes_a.astype(np.int64) + codes_b, minlength=16).reshape(4, 4)
    spans_a, spans_b = spans_of(a), spans_of(b)
    n_samples = max(len(times), 1)
    # As many onsets as possible are matched, with the smallest sum of differences: a pair that is
    # too far apart costs more than all that are near.
    onsets_a, onsets_b = _onsets(a), _onsets(b)
    differences = onsets_b[None, :] - onsets_a[:, None]
    near = np.abs(differences) <= MAX_ONSET_DIFFERENCE + TIME_TOLERANCE
    too_far = (len(onsets_a) + len(onsets_b) + 1) * (MAX_ONSET_DIFFERENCE + TIME_TOLERANCE)
    rows, columns = linear_sum_assignment(np.where(near, np.abs(differences), too_far))
    kept = near[rows, columns]
    matched = differences[rows[kept], columns[kept]].tolist()
    # Causes are compared where both name one: code 0 is none.
    n_causes = len(CAUSE_BY_CODE)
    pairs = n_causes * _cause_codes(a, times) + _cause_codes(b, times)
    causes = np.bincount(pairs, minlength=n_causes**2).reshape(n_causes, n_causes)[1:, 1:]
    return FingerAgreement(
        *_kappas(table[1:, 1:]),
        n_samples=len(times),
        only_a=int(table[1:, 0].sum()) / n_samples,
        only_b=int(table[0, 1:].sum()) / n_samples,
        confusion=table[1:, 1:].tolist(),
        onset_differences=_differences(
            matched, len(onsets_a) - len(matched), len(onsets_b) - len(matched)
        ),
        causes=causes.tolist(),
        kappa_cause=cohens_kappa(causes),
        missing_in_a=_unmatched(spans_b, spans_a),
        missing_in_b=_unmatched(spans_a, spans_b),
    )


def _pooled(parts: Sequence[FingerAgreement]) -> PooledAgreement:
    confusion = sum((np.array(part.confusion) for part in parts), np.zeros((3, 3), dtype=np.int64))
    causes = sum((np.array(part.causes) for part in parts), np.zeros_like(NO_CAUSES))
    n_samples = sum(part.n_samples for part in parts)
    onsets = [part.onset_differences for part in parts]
    return PooledAgreement(
        *_kappas(confusion),
        n_samples=n_samples,
        only_a=sum(part.only_a * part.n_samples for part in parts) / max(n_samples, 1),
        only_b=sum(part.only_b * part.n_samples for part in parts) / max(n_samples, 1),
        confusion=confusion.tolist(),
        onset_differences=_differences(
            [value for onset in onsets for value in onset.values],
            sum(onset.only_a for onset in onsets),
            sum(onset.only_b for onset in onsets),
        ),
        causes=causes.tolist(),
        kappa_cause=cohens_kappa(causes),
        n_missing_in_a=sum(len(part.missing_in_a) for part in parts),
        n_missing_in_b=sum(len(part.missing_in_b) for part in parts),
    )


def _cause_codes(labels: Sequence[Label], times: Array) -> npt.NDArray[np.int64]:
    """Return (n,) the code of the labelled cause at each time; 0 without one."""
    codes = np.zeros(len(times), dtype=np.int64)
    for label in labels:
        first, last = np.searchsorted(times, (label.start, label.end))
        codes[first:last] = CAUSE_BY_CODE.index(label.cause)
    return codes


def _kappas(confusion: Confusion) -> tuple[float | None, float | None, int]:
    """Return kappa of three states, kappa of stable against the others, and number of samples."""
    binary = np.add.reduceat(np.add.reduceat(confusion, [0, 2], axis=0), [0, 2], axis=1)
    return cohens_kappa(confusion), cohens_kappa(binary), int(confusion.sum())


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
    """Return the onsets of instability in labels in order of time [s]."""
    return np.array(
        [
            after.start
            for before, after in pairwise(labels)
            if before.state is ContactState.STABLE
            and after.state is not ContactState.STABLE
            and after.start - before.end <= MAX_LABEL_GAP + TIME_TOLERANCE
        ],
        dtype=np.float64,
    )


def _unmatched(spans: Sequence[Span], others: Sequence[Span]) -> list[Span]:
    """Return the spans that none of the others with the same state overlaps."""

    def matches(span: Span, other: Span) -> bool:
        return span.state == other.state and span.overlap(other) > TIME_TOLERANCE

    return [span for span in spans if not any(matches(span, other) for other in others)]
