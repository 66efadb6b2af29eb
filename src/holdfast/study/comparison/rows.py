"""Rows out of what was counted of each recording, with intervals by bootstrap over recordings."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from holdfast.metrics import Interval, Metrics, SampleMetrics, bootstrap_interval, ratio_of_sums
from holdfast.metrics.intervals import Statistic, quantile_of
from holdfast.metrics.statistics import quantile
from holdfast.sensors.types import Array
from holdfast.study.evaluation.evaluate_method import MethodEvaluation
from holdfast.study.report.result_tables import Key, Row

Keys = Mapping[str, Key]

PERCENT = 100.0

SAMPLE_FIGURES = {
    "accuracy [%]": "accuracy",
    "FDR [%]": "fdr",
    "FNR [%]": "fnr",
    "AUC": "auc",
    "AUC contact": "auc_contact",
    "Brier": "brier",
}
"""By the head of a column, the name among the sample metrics."""
DIGITS = {"AUC": 3, "AUC contact": 3, "Brier": 3}


def ratio_row(
    keys: Keys,
    parts: npt.ArrayLike,
    wholes: npt.ArrayLike,
    seed: int,
    scale: float = PERCENT,
    paper: float | None = None,
) -> Row:
    """The ratio of two sums over recordings; those with nothing of the whole do not count.

    Args:
        keys: of the row.
        parts: (n_recordings,).
        wholes: (n_recordings,).
        seed: of the bootstrap.
        scale: that the ratio is multiplied by.
        paper: what the paper prints.
    """
    part, whole = np.asarray(parts, dtype=np.float64), np.asarray(wholes, dtype=np.float64)
    part, whole = part[whole > 0] * scale, whole[whole > 0]
    n = len(whole)
    ours = float(part.sum() / whole.sum()) if n else None
    interval = bootstrap_interval(ratio_of_sums(part, whole), n, seed=seed) if n else None
    return Row(dict(keys), ours, paper, n, interval)


def quantile_row(keys: Keys, values: Sequence[Sequence[float]], q: float, seed: int) -> Row:
    """A quantile of all values of all recordings; they may be infinite.

    Args:
        keys: of the row.
        values: of each recording; those without any do not count.
        q: from 0 to 1.
        seed: of the bootstrap.
    """
    known: list[Array] = [np.array(each, dtype=np.float64) for each in values if len(each)]
    ours = quantile(np.sort(np.concatenate([np.empty(0), *known])), q)
    interval = bootstrap_interval(quantile_of(known, q), len(known), seed=seed) if known else None
    return Row(dict(keys), ours, None, len(known), interval)


def count_row(keys: Keys, counts: Sequence[int]) -> Row:
    """How many there are in all recordings."""
    return Row(dict(keys), float(sum(counts)), None, len(counts))


def sample_rows(
    keys: Keys,
    metrics: Metrics,
    figures: Sequence[str] = tuple(SAMPLE_FIGURES),
    paper: Mapping[str, float] | None = None,
) -> list[Row]:
    """Figures by sample, pooled over fingers and recordings.

    Args:
        keys: of the rows.
        metrics: whose.
        figures: of `SAMPLE_FIGURES`.
        paper: what the paper prints, by the same names.
    """
    rows = []
    for figure in figures:
        name = SAMPLE_FIGURES[figure]
        interval: Interval | None = None
        n = sum(
            any(known(finger) for finger in each.fingers.values()) for each in metrics.recordings
        )
        if metrics.intervals is not None:
            interval, n = getattr(metrics.intervals, name), metrics.intervals.n_recordings
        ours: float | None = getattr(metrics.pooled, name)
        about = {**keys, "figure": figure}
        rows.append(Row(about, ours, (paper or {}).get(figure), n, interval))
    return rows


def known(metrics: SampleMetrics) -> bool:
    """Whether any sample counts."""
    return metrics.n > 0


def right_and_all(metrics: Metrics) -> dict[str, tuple[int, int]]:
    """Of each recording, how many samples were told right, and how many there were."""
    counts = {}
    for recording in metrics.recordings:
        tables = np.array([f.confusion for f in recording.fingers.values()]).reshape(-1, 2, 2)
        total = tables.sum(axis=0)
        counts[recording.name] = (int(np.trace(total)), int(total.sum()))
    return counts


def difference_row(keys: Keys, first: Metrics, second: Metrics, seed: int) -> Row:
    """Accuracy of the first less that of the second, on the same recordings [points].

    A resample draws the same recordings for both.
    """
    one, other = right_and_all(first), right_and_all(second)
    names = [name for name in one if name in other and one[name][1] and other[name][1]]
    counts = np.array([(*one[name], *other[name]) for name in names], dtype=np.float64)
    statistic = _difference(counts.reshape(-1, 4))
    ours = float(statistic(np.ones((1, len(names))))[0]) if names else None
    interval = bootstrap_interval(statistic, len(names), seed=seed)
    return Row(dict(keys), ours, None, len(names), interval)


def _difference(counts: Array) -> Statistic:
    def statistic(draws: Array) -> Array:
        right, n, other_right, other_n = (draws @ counts).T
        return np.asarray(PERCENT * (right / n - other_right / other_n))

    return statistic


def calibration_row(keys: Keys, judged: MethodEvaluation, seed: int) -> Row:
    """How far given probabilities are from what was so, mean over samples, by ten bins."""
    table = np.array(judged.calibration, dtype=np.float64).reshape(len(judged.names), -1, 3)
    table = table[table[:, :, 2].sum(axis=1) > 0]

    def statistic(draws: Array) -> Array:
        p, stable, n = np.einsum("dr,rbk->kdb", draws, table)
        return np.asarray(np.abs(p - stable).sum(axis=1) / n.sum(axis=1))

    n = len(table)
    ours = float(statistic(np.ones((1, n)))[0]) if n else None
    return Row(dict(keys), ours, None, n, bootstrap_interval(statistic, n, seed=seed))
