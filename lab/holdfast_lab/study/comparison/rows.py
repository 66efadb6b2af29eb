"""Table rows from counts by recording, with intervals by bootstrap over recordings."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from holdfast.metrics import Interval, Metrics, bootstrap_interval, ratio_of_sums
from holdfast.metrics.statistics import quantile, quantile_of
from holdfast.sensors.types import Array
from holdfast_lab.figures.curves import PlottedCurve
from holdfast_lab.report.result_tables import Key, Row
from holdfast_lab.study.evaluation.evaluate_method import MethodEvaluation

RowKeys = Mapping[str, Key]

PERCENT = 100.0
WITHOUT_ESTIMATE = "without estimate [%]"

SAMPLE_METRICS = {
    "accuracy [%]": "accuracy",
    "FDR [%]": "fdr",
    "FNR [%]": "fnr",
    "AUC": "auc",
    "AUC contact": "auc_contact",
    "Brier": "brier",
}
"""Name of a sample metric, by the head of its column."""
DIGITS = {"AUC": 3, "AUC contact": 3, "Brier": 3}
"""Digits after the decimal point, by the head of the column."""


def ratio_row(
    keys: RowKeys,
    parts: npt.ArrayLike,
    wholes: npt.ArrayLike,
    seed: int,
    scale: float = PERCENT,
    paper: float | None = None,
) -> Row:
    """Return the ratio of two sums over recordings. Recordings with a whole of 0 are left out.

    Args:
        keys: of the row.
        parts: (n_recordings,).
        wholes: (n_recordings,).
        seed: of the bootstrap.
        scale: factor of the ratio.
        paper: the value that the paper prints.
    """
    part, whole = np.asarray(parts, dtype=np.float64), np.asarray(wholes, dtype=np.float64)
    part, whole = part[whole > 0] * scale, whole[whole > 0]
    n = len(whole)
    ours = float(part.sum() / whole.sum()) if n else None
    interval = bootstrap_interval(ratio_of_sums(part, whole), n, seed=seed) if n else None
    return Row(dict(keys), ours, paper, n, interval)


def quotient_row(keys: RowKeys, base: Array, ours: Array, seed: int) -> Row:
    """Return the share of errors of a baseline divided by ours; infinite if we have none.

    The interval is paired: a resample draws the same recordings for both.

    Args:
        keys: of the row.
        base: (n_recordings, 2) errors, and all samples or events, of the baseline.
        ours: the same of our method, for the same recordings.
        seed: of the bootstrap.
    """
    counts = np.column_stack([base, ours]).astype(np.float64)
    # A recording counts only if both have samples in it, or the pairs would differ.
    counts = counts[(counts[:, 1] > 0) & (counts[:, 3] > 0)]

    def statistic(draws: Array) -> Array:
        wrong, n, our_wrong, our_n = (draws @ counts).T
        # A resample without an error of ours is infinite, or NaN if there is none of either.
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((wrong / n) / (our_wrong / our_n))

    n = len(counts)
    value = float(statistic(np.ones((1, n)))[0]) if n else None
    interval = bootstrap_interval(statistic, n, seed=seed)
    return Row(dict(keys), None if value is None or np.isnan(value) else value, None, n, interval)


def quantile_row(keys: RowKeys, values: Sequence[Sequence[float]], q: float, seed: int) -> Row:
    """Return a quantile of the values of all recordings; values may be infinite.

    Args:
        keys: of the row.
        values: of each recording. Recordings without values are left out.
        q: from 0 to 1.
        seed: of the bootstrap.
    """
    samples: list[Array] = [np.array(value, dtype=np.float64) for value in values if len(value)]
    ours = quantile(np.sort(np.concatenate([np.empty(0), *samples])), q)
    interval = (
        bootstrap_interval(quantile_of(samples, q), len(samples), seed=seed) if samples else None
    )
    return Row(dict(keys), ours, None, len(samples), interval)


def count_row(keys: RowKeys, counts: Sequence[int]) -> Row:
    """Return the sum of the counts of all recordings."""
    return Row(dict(keys), float(sum(counts)), None, len(counts))


def sample_rows(
    keys: RowKeys,
    metrics: Metrics,
    figures: Sequence[str] = tuple(SAMPLE_METRICS),
    paper: Mapping[str, float] | None = None,
) -> list[Row]:
    """Return metrics by sample, pooled over fingers and recordings.

    Args:
        keys: of the rows.
        metrics: of a method.
        figures: heads of the columns, of `SAMPLE_METRICS`.
        paper: the values that the paper prints, by the same heads.
    """
    rows = []
    for figure in figures:
        name = SAMPLE_METRICS[figure]
        interval: Interval | None = None
        n = sum(
            any(finger.n > 0 for finger in recording.fingers.values())
            for recording in metrics.recordings
        )
        if metrics.intervals is not None:
            interval, n = getattr(metrics.intervals, name), metrics.intervals.n_recordings
        ours: float | None = getattr(metrics.pooled, name)
        row_keys = {**keys, "figure": figure}
        rows.append(Row(row_keys, ours, (paper or {}).get(figure), n, interval))
    return rows


def without_estimate_row(keys: RowKeys, counts: Sequence[tuple[int, int]], seed: int) -> Row:
    """Return the share of labelled samples without an estimate [%].

    Args:
        keys: of the row, but for its figure.
        counts: labelled samples, and those of them without an estimate, of each recording.
        seed: of the bootstrap.
    """
    n, n_without = np.array(counts, dtype=np.float64).reshape(-1, 2).T
    return ratio_row({**keys, "figure": WITHOUT_ESTIMATE}, n_without, n, seed)


def correct_and_all(metrics: Metrics) -> dict[str, tuple[int, int]]:
    """Return the number of correct samples, and of all samples, of each recording."""
    counts = {}
    for recording in metrics.recordings:
        tables = np.array([f.confusion for f in recording.fingers.values()]).reshape(-1, 2, 2)
        total = tables.sum(axis=0)
        counts[recording.name] = (int(np.trace(total)), int(total.sum()))
    return counts


def difference_row(keys: RowKeys, first: Metrics, second: Metrics, seed: int) -> Row:
    """Return the accuracy of `first` minus that of `second`, on the same recordings [points].

    The interval is paired: a resample draws the same recordings for both.
    """
    errors, other = correct_and_all(first), correct_and_all(second)
    names = [name for name in errors if name in other and errors[name][1] and other[name][1]]
    counts = np.array([(*errors[name], *other[name]) for name in names], dtype=np.float64)

    def statistic(draws: Array) -> Array:
        correct, n, other_correct, other_n = (draws @ counts.reshape(-1, 4)).T
        return np.asarray(PERCENT * (correct / n - other_correct / other_n))

    ours = float(statistic(np.ones((1, len(names))))[0]) if names else None
    interval = bootstrap_interval(statistic, len(names), seed=seed)
    return Row(dict(keys), ours, None, len(names), interval)


def curve_of(rows: Sequence[Row], key: str) -> PlottedCurve:
    """Return the values of rows over one of their keys, with their intervals."""
    ordered = sorted(rows, key=lambda row: float(row.keys[key]))
    ends = [row.interval or (None, None) for row in ordered]
    y, low, high = (
        np.array([np.nan if value is None else float(value) for value in values])
        for values in ([row.ours for row in ordered], [a for a, _ in ends], [b for _, b in ends])
    )
    return PlottedCurve(np.array([float(row.keys[key]) for row in ordered]), y, low, high)


def calibration_row(keys: RowKeys, evaluation: MethodEvaluation, seed: int) -> Row:
    """Return the calibration error: |mean probability - share of stable samples|, by ten bins.

    The error is the mean over samples.
    """
    table = np.array(evaluation.calibration, dtype=np.float64)
    table = table.reshape(len(evaluation.calibration), -1, 3)
    table = table[table[:, :, 2].sum(axis=1) > 0]

    def statistic(draws: Array) -> Array:
        p, stable, n = np.einsum("dr,rbk->kdb", draws, table)
        return np.asarray(np.abs(p - stable).sum(axis=1) / n.sum(axis=1))

    n = len(table)
    ours = float(statistic(np.ones((1, n)))[0]) if n else None
    return Row(dict(keys), ours, None, n, bootstrap_interval(statistic, n, seed=seed))
