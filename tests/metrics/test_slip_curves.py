"""Choice of the threshold of slips, and intervals that include it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from holdfast.metrics.slip_curves import (
    SLIP_THRESHOLDS,
    choose_threshold,
    held_out_indices,
    slip_curve,
    slip_intervals,
    summarise_choice,
)
from holdfast.metrics.slip_truth import NOT_HELD, SlipDecisions
from holdfast.metrics.slips import SlipCounts, count_slips, slip_metrics

from .slips import RATE, decisions, slip


def random_recording(seed, n_false):
    """Return decisions with random probabilities: high in a slip and in some still samples."""
    generator = np.random.default_rng(seed)
    made = decisions([], [slip()], seconds=20)
    probability = generator.uniform(0.0, 0.3, len(made.times))
    probability[500:600] = generator.uniform(0.6, 0.95)
    for start in generator.integers(700, 1900, n_false):
        probability[start] = generator.uniform(0.5, 0.9)
    return SlipDecisions(made.times, probability, made.raised, 0.0, made.truth)


CHOICE = 1.0


def held_out(curves, groups):
    """Return the index for each recording, chosen without its group from those that are there."""
    (indices,) = held_out_indices(curves, CHOICE, groups, np.ones((1, len(curves))))
    return indices


class TestThresholds:
    curves = tuple(slip_curve(random_recording(seed, seed % 4)) for seed in range(8))

    def test_the_lowest_that_fits_is_chosen(self):
        total = SlipCounts.total(self.curves)
        index = choose_threshold(total, CHOICE)
        rates = [60 * counts.false_held / counts.held_seconds for counts in total]
        assert rates[index] <= 1.0
        assert rates[index - 1] > 1.0
        assert all(rate <= 1.0 for rate in rates[index:])

    def test_quiet_and_disturbed_time_count_with_their_shares_of_use(self):
        total = SlipCounts.total(self.curves)
        quiet = total.held_seconds * 0.9
        total = replace(total, quiet_seconds=quiet, false_quiet=total.false_held // 2)
        disturbed = total.false_held - total.false_quiet
        rates = 36 * total.false_quiet / quiet + 24 * disturbed / (total.held_seconds - quiet)
        rates += 60 / total.held_seconds
        index = choose_threshold(total, 9.0, "use")
        assert (rates[index:] <= 9.0).all()
        assert rates[index - 1] > 9.0

    def test_a_summary_has_the_threshold_of_other_recordings_or_of_other_groups(self):
        tested, training = (
            [{"thumb": c} for c in part] for part in (self.curves[:4], self.curves[4:])
        )
        for choice in (1.0, -1.0):  # the second allows nothing
            index = choose_threshold(SlipCounts.total(self.curves[4:]), choice)
            summary = summarise_choice(tested, choice, training=training)
            assert summary.threshold_chosen and summary.intervals is not None
            counts = SlipCounts.total(self.curves[:4])[-1 if index is None else index]
            assert summary.pooled == summary.fingers["thumb"] == slip_metrics(counts)
        groups = [0, 0, 1, 1]
        indices = held_out(self.curves[:4], groups)
        counts = SlipCounts.total(c[k] for c, k in zip(self.curves, indices, strict=False))
        summary = summarise_choice(tested, 1.0, groups=groups)
        assert summary.pooled == slip_metrics(counts)

    def test_a_curve_is_the_counts_at_each_threshold(self):
        slips = [slip(), slip(8.0, 8.3, gross=8.1, reached=(8.05, math.nan))]
        made = replace(
            decisions([], slips, seconds=20),
            probability=random_recording(5, 9).probability,
            hold=0.2,
        )
        for index in (40, 60, 80, 90):
            (raised,) = made.raised_at(SLIP_THRESHOLDS[[index]])
            expected = vars(count_slips(replace(made, raised=raised)))
            counts = vars(slip_curve(made)[index])
            assert raised.any()
            assert {name: np.asarray(value).tolist() for name, value in counts.items()} == {
                name: np.asarray(value).tolist() for name, value in expected.items()
            }

    def test_none_if_no_threshold_fits(self):
        probability = np.ones(1000)
        made = SlipDecisions(
            np.arange(1000) / RATE, probability, probability > 0, 0.0, decisions([]).truth
        )
        assert choose_threshold(slip_curve(made), CHOICE) is None

    def test_a_recording_is_scored_by_the_threshold_of_the_others(self):
        indices = held_out(self.curves, range(8))
        for own, index in enumerate(indices):
            others = [curve for k, curve in enumerate(self.curves) if k != own]
            total = SlipCounts.total(others)
            assert index == choose_threshold(total, CHOICE)

    @pytest.mark.parametrize("groups", [range(8), (0, 0, 1, 1, 2, 2, 3, 3)])
    def test_intervals_with_the_choice_are_of_recordings_left_out(self, groups):
        indices = held_out(self.curves, groups)
        scored = [curve[index] for curve, index in zip(self.curves, indices, strict=True)]
        point = slip_metrics(SlipCounts.total(scored))
        recordings = [{"thumb": curve} for curve in self.curves]
        found = summarise_choice(recordings, CHOICE, groups=groups).intervals
        low, high = found.false_alarms_per_minute["held"]
        assert low <= point.false_alarms_per_minute["held"] <= high
        assert high > 1.0  # the rate that was asked for holds in sample only
        low, high = found.incipient["0.1"]
        assert low <= point.incipient["0.1"] <= high

    def test_a_single_group_gets_the_highest_threshold(self):
        indices = held_out(self.curves[:2], (0, 0))
        assert indices.tolist() == [len(SLIP_THRESHOLDS) - 1] * 2

    def test_no_threshold_where_nothing_is_held(self):
        codes = np.full(1000, NOT_HELD, dtype=np.int8)
        assert choose_threshold(slip_curve(decisions([], codes=codes)), CHOICE) is None

    def test_no_interval_of_one_recording(self):
        assert slip_intervals(self.curves[:1]) is None
