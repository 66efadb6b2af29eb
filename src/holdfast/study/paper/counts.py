"""Confusion counts by recording, and the figures that follow from them."""

from collections.abc import Iterable, Iterator

import numpy as np

from holdfast.classifiers import Classifier, Samples
from holdfast.metrics import bootstrap_interval, ratio_of_sums
from holdfast.metrics.intervals import Interval
from holdfast.metrics.statistics import percent
from holdfast.study.paper.pools import Integers
from holdfast.study.report.tables import Row

Counts = list[list[int]]
"""Of each recording [TN, FP, FN, TP]."""

FIGURES: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "TNR": ((0,), (0, 1)),
    "FPR": ((1,), (0, 1)),
    "FNR": ((2,), (2, 3)),
    "TPR": ((3,), (2, 3)),
    "FDR": ((1,), (1, 3)),
    "accuracy": ((0, 3), (0, 1, 2, 3)),
}
"""Which of TN, FP, FN, TP each figure divides by which."""


def confusions(classifier: Classifier, samples: Samples, n_recordings: int) -> Integers:
    """(n_recordings, 4) how many TN, FP, FN and TP each recording has; it alone decides."""
    called = classifier.probability(samples.features) >= classifier.threshold
    place = 4 * samples.groups + 2 * samples.stable + called
    return np.bincount(place, minlength=4 * n_recordings).reshape(-1, 4)


def figures(counts: Counts, names: Iterable[str], seed: int) -> Iterator[tuple[str, Row]]:
    """Each figure of confusion counts by recording, as a row that has no keys yet.

    Args:
        counts: [TN, FP, FN, TP] of each recording; recordings without samples do not count.
        names: of `FIGURES`.
        seed: of the bootstrap.
    """
    table = np.array(counts, dtype=np.int64).reshape(-1, 4)
    table = table[table.sum(axis=1) > 0]
    for name in names:
        part, whole = (table[:, list(columns)].sum(axis=1) for columns in FIGURES[name])
        ours = percent(int(part.sum()), int(whole.sum()))
        interval = bootstrap_interval(ratio_of_sums(part, whole), len(table), seed=seed)
        yield name, Row({}, ours, n=len(table), interval=_percent(interval))


def _percent(interval: Interval | None) -> Interval | None:
    if interval is None:
        return None
    low, high = (None if end is None else 100 * end for end in interval)
    return low, high
