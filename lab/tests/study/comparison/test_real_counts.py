import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast_lab.study.comparison.real_counts import (
    common_samples,
    count_pairs,
    count_recordings,
    mean_auc_row,
    pair_rows,
    recording_rows,
)
from holdfast_lab.study.comparison.real_estimates import (
    Column,
    RecordingEstimates,
    RecordingLabels,
    UnitLabels,
    unit_estimates,
)

RATE = 100.0
N = 300
TIMES = np.arange(N) / RATE
SLIP = (TIMES >= 1.0) & (TIMES < 1.4)
"""The one slip; before it everything is stable, after it too."""


def unit_labels(codes, slip=SLIP):
    codes = np.asarray(codes, dtype=np.int8)
    return UnitLabels(Column.of(TIMES), Column.of(codes), Column.of(slip & (codes != UNKNOWN)))


def labels(codes=None, slip=SLIP, name="a"):
    codes = np.where(SLIP, UNSTABLE, STABLE) if codes is None else codes
    unit = unit_labels(codes, slip)
    return RecordingLabels(name, {"finger1": unit, "finger2": unit}, unit)


def estimates(probability, states=None, first=0, fingers=("finger1", "finger2"), name="a"):
    """Estimates that are the same for both fingers and the hand, from sample `first` on."""
    probability = np.where(np.arange(N) < first, np.nan, probability)
    states = (
        np.where(np.asarray(probability) >= 0.5, STABLE, UNSTABLE) if states is None else states
    )
    states = np.where(np.arange(N) < first, UNKNOWN, states).astype(np.int8)
    unit = unit_estimates(probability, states)
    known = Column.of(states != UNKNOWN)
    return RecordingEstimates(name, dict.fromkeys(fingers, unit), unit, Column.of(states), known)


RIGHT = np.where(SLIP, 0.1, 0.9)


def values(rows):
    return {row.keys["figure"]: row.ours for row in rows}


def figures(label, **methods):
    counts = count_recordings([label], {name: [each] for name, each in methods.items()})
    return {name: values(recording_rows({}, each, 0)) for name, each in counts.items()}


def test_a_method_without_errors():
    (found,) = figures(labels(), right=estimates(RIGHT)).values()
    assert found == {
        "AUC": 1.0,
        "AUC of the hand": 1.0,
        "accuracy [%]": 100.0,
        "stable called STABLE [%]": 100.0,
        "without estimate [%]": 0.0,
        "slips": 1.0,
        "missed slips [%]": 0.0,
        "false alarms per minute": 0.0,
    }


def test_all_are_scored_where_all_have_an_estimate():
    """The second has none in the first 1.2 s, and takes half of the slip from the first."""
    wrong_at_first = np.where(TIMES < 1.2, 1.0 - RIGHT, RIGHT)
    found = figures(labels(), one=estimates(wrong_at_first), two=estimates(RIGHT, first=120))
    assert found["one"]["AUC"] == found["one"]["accuracy [%]"] / 100 == 1.0
    assert found["one"]["without estimate [%]"] == 0.0
    assert found["two"]["without estimate [%]"] == pytest.approx(100 * 120 / 300)
    assert found["one"]["slips"] == 0  # not stable for 0.5 s before, where both have an estimate
    alone = figures(labels(), one=estimates(wrong_at_first))["one"]
    assert alone["accuracy [%]"] == pytest.approx(100 * 180 / 300)


def test_a_method_without_any_estimate_takes_no_sample_away():
    never = estimates(RIGHT, first=N)
    assert common_samples([estimates(RIGHT, first=7), never]).sum() == N - 7
    assert common_samples([never]).sum() == 0
    found = figures(labels(), right=estimates(RIGHT), never=never)
    assert found["right"]["accuracy [%]"] == 100.0
    assert found["never"]["without estimate [%]"] == 100.0
    assert found["never"]["AUC"] is found["never"]["accuracy [%]"] is None


def test_false_alarms_are_those_under_a_stable_label():
    alarms = RIGHT.copy()
    alarms[[20, 50, 250]] = 0.1
    codes = np.where(SLIP, UNSTABLE, STABLE)
    codes[40:60] = UNKNOWN
    (found,) = figures(labels(codes), one=estimates(alarms)).values()
    stable_minutes = (300 - 40 - 20) / RATE / 60
    assert found["false alarms per minute"] == pytest.approx(2 / stable_minutes)


def test_a_whole_hand_method_is_counted_by_its_hand():
    found = figures(labels(), one=estimates(RIGHT), hand=estimates(RIGHT, first=10, fingers=()))
    assert found["hand"]["without estimate [%]"] == pytest.approx(100 * 10 / 300)
    assert found["hand"]["AUC"] == found["one"]["AUC"] == 1.0
    counts = count_recordings([labels()], {"hand": [estimates(RIGHT, fingers=())]})["hand"]
    assert [unit.n for unit in counts[0].units] == [N]


def noisy(seed):
    return np.clip(RIGHT + np.random.default_rng(seed).normal(0.0, 0.6, N), 0.0, 1.0)


class TestIntervals:
    def counts(self, n):
        own = [estimates(noisy(seed), name=str(seed)) for seed in range(n)]
        every = [labels(name=str(seed)) for seed in range(n)]
        return every, count_recordings(every, {"one": own})["one"]

    def test_a_pair_is_paired(self):
        """Two methods with the same scores have a difference of 0 without width."""
        every, _ = self.counts(4)
        one = [estimates(noisy(seed)) for seed in range(4)]
        other = [estimates(noisy(seed + 10), first=30) for seed in range(4)]
        same = {r.keys["figure"]: r for r in pair_rows({}, count_pairs(every, one, one), 0)}
        assert (same["difference"].ours, same["difference"].interval) == (0.0, (0.0, 0.0))
        pairs = count_pairs(every, one, other)
        assert [len(each.first.stable) for each in pairs] == [2 * (N - 40 - 30)] * 4
        rows = {r.keys["figure"]: r for r in pair_rows({}, pairs, 0)}
        assert rows["difference"].ours == pytest.approx(
            rows["AUC of builtin:any"].ours - rows["AUC"].ours
        )
        assert rows["difference"].interval[0] < rows["difference"].ours


def test_the_mean_auc_does_not_depend_on_the_scale_of_a_recording():
    """The second recording has all scores below those of the first; the third has no slip."""
    every = [labels(), labels(), labels(np.full(N, STABLE), np.zeros(N, dtype=bool))]
    own = [estimates(0.5 + RIGHT / 2), estimates(RIGHT / 4), estimates(RIGHT)]
    counts = count_recordings(every, {"one": own})["one"]
    row = mean_auc_row({}, counts, 0)
    assert (row.ours, row.n, row.interval) == (1.0, 2, None)
    assert recording_rows({}, counts, 0)[0].ours < 1.0
    assert mean_auc_row({}, counts[2:], 0).ours is None
    assert mean_auc_row({}, [*counts, *counts], 0).interval == (1.0, 1.0)
