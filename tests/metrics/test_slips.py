"""Score of decisions about slips: the protocol of DESIGN, by hand and by a slow twin."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.metrics.slip_thresholds import (
    SLIP_THRESHOLDS,
    ThresholdChoice,
    choose_threshold,
    held_out_places,
    slip_curve,
    slip_intervals,
    slip_summary,
    summarise_choice,
)
from holdfast.metrics.slip_truth import (
    CREEPING,
    NOT_HELD,
    SLIDING,
    STILL,
    Slip,
    SlipDecisions,
    SlipTruth,
    truth_impacts,
)
from holdfast.metrics.slips import SlipCounts, SlipCurve, count_slips, slip_metrics
from holdfast.recordings import Truth

RATE = 100.0


def decisions(raised, slips=(), *, seconds=10.0, codes=None, quiet=None, probability=None):
    """Return decisions that are raised in some intervals [s]."""
    n = round(seconds * RATE)
    times = np.arange(n) / RATE
    mask = np.zeros(n, dtype=bool)
    for start, end in raised:
        mask[round(start * RATE) : round(end * RATE)] = True
    if codes is None:
        codes = np.full(n, STILL, dtype=np.int8)
        for slip in slips:
            codes[round(slip.onset * RATE) : round(slip.end * RATE)] = SLIDING
    truth = SlipTruth(codes, codes == STILL if quiet is None else quiet, tuple(slips), "truth")
    values = np.where(mask, 0.9, 0.1) if probability is None else probability
    return SlipDecisions(times, values, mask, 0.0, truth)


def slip(onset=5.0, end=6.0, gross=math.nan, reached=(math.nan, math.nan)):
    return Slip(onset, end, gross, 5e-4 if math.isnan(reached[0]) else 2e-3, reached)


class TestFound:
    @pytest.mark.parametrize(
        ("alarm", "shares"),
        [
            (4.4, [0, 0, 0, 0]),  # earlier than 0.5 s before: it finds nothing
            (4.6, [100, 100, 100, 100]),
            (5.0, [0, 100, 100, 100]),
            (5.04, [0, 0, 100, 100]),
            (5.09, [0, 0, 0, 100]),
            (5.2, [0, 0, 0, 0]),
        ],
    )
    def test_incipient(self, alarm, shares):
        metrics = slip_metrics(count_slips(decisions([(alarm, 7.0)], [slip()])))
        assert list(metrics.incipient.values()) == shares

    def test_gross_counts_from_its_own_onset(self):
        metrics = slip_metrics(count_slips(decisions([(5.15, 6.0)], [slip(gross=5.2)])))
        assert metrics.incipient["0.1"] == 0
        assert metrics.gross == {"before": 100, "0.03": 100, "0.05": 100, "0.1": 100}
        assert metrics.n_gross == 1

    @pytest.mark.parametrize(("alarm", "before"), [(5.3, 100), (5.4, 0)])
    def test_before_1mm(self, alarm, before):
        made = slip(reached=(5.35, math.nan))
        metrics = slip_metrics(count_slips(decisions([(alarm, 6.0)], [made])))
        assert (metrics.before_1mm, metrics.before_3mm) == (before, None)
        assert metrics.n_over_1mm == 1

    def test_a_flag_that_is_always_raised_finds_nothing(self):
        metrics = slip_metrics(count_slips(decisions([(0.0, 10.0)], [slip()])))
        assert metrics.incipient["0.1"] == 0
        assert metrics.false_alarms_per_minute["held"] == pytest.approx(
            17 * 60 / 8.25,
            rel=0.01,  # 4.5 and 3.75 s in begun 0.5 s, of as much time
        )


class TestFalseAlarms:
    @pytest.mark.parametrize(
        ("raised", "n"),
        [
            ([(1.0, 1.01)], 1),
            ([(1.0, 1.5)], 1),
            ([(1.0, 1.51)], 2),
            ([(1.0, 1.1), (2.0, 2.1)], 2),
            ([(5.1, 6.2)], 0),  # until 0.25 s after the end of the slip
            ([(5.1, 6.5)], 1),
            ([(4.6, 5.0)], 0),
            ([(4.0, 5.0)], 1),
            ([], 0),
        ],
    )
    def test_number(self, raised, n):
        assert count_slips(decisions(raised, [slip()])).false_held == n

    def test_creep_is_neither(self):
        codes = np.full(1000, STILL, dtype=np.int8)
        codes[100:200] = CREEPING
        counts = count_slips(decisions([(1.0, 2.0)], codes=codes))
        assert counts.false_held == 0
        assert counts.held_seconds == pytest.approx(9.0)

    def test_what_is_not_held_does_not_count(self):
        codes = np.full(1000, STILL, dtype=np.int8)
        codes[500:] = NOT_HELD
        counts = count_slips(decisions([(6.0, 9.0)], codes=codes))
        assert counts.false_held == 0
        assert counts.held_seconds == pytest.approx(5.0)

    def test_sliding_that_is_no_slip_is_neither(self):
        codes = np.full(1000, STILL, dtype=np.int8)
        codes[100:102] = SLIDING
        counts = count_slips(decisions([(1.0, 1.02)], codes=codes))
        assert counts.false_held == 0
        assert counts.held_seconds == pytest.approx(9.98)

    @given(st.floats(0.5, 9.0))
    @settings(max_examples=20)
    def test_a_flag_that_is_always_raised_has_two_a_second(self, onset):
        counts = count_slips(decisions([(0.0, 10.0)], [slip(onset, onset + 0.5)]))
        assert counts.false_held >= 2 * counts.held_seconds - 1e-6
        assert counts.false_held <= 2 * counts.held_seconds + 2

    def test_a_gap_counts_as_three_periods(self):
        made = decisions([(1.0, 1.01)], [])
        late = np.where(made.times < 1.005, made.times, made.times + 60.0)
        counts = count_slips(replace(made, times=late))
        assert counts.false_held == 1
        assert counts.held_seconds == pytest.approx(10.02)

    def test_quiet_is_a_part_of_held(self):
        quiet = np.zeros(1000, dtype=bool)
        quiet[:300] = True
        counts = count_slips(decisions([(1.0, 1.1), (5.0, 5.1)], quiet=quiet))
        assert (counts.false_quiet, counts.false_held) == (1, 2)
        metrics = slip_metrics(counts)
        assert metrics.raised_quiet == pytest.approx(100 * 0.1 / 3)


def naive_counts(made):
    """Return found within 0.1 s, and false alarms of held time, sample by sample."""
    times, raised, truth = made.times, made.raised, made.truth
    found = 0
    for item in truth.slips:
        for k in range(len(times)):
            is_alarm = raised[k] and (k == 0 or not raised[k - 1])
            in_time = item.onset - 0.5 - 1e-6 <= times[k] <= item.onset + 0.1 + 1e-6
            if is_alarm and in_time and times[k] <= item.end + 0.25:
                found += 1
                break
    false, wrong = 0, 0
    for k in range(len(times) + 1):
        inside = k < len(times) and any(
            item.onset - 0.5 - 1e-6 <= times[k] <= item.end + 0.25 + 1e-6 for item in truth.slips
        )
        if k == len(times) or not raised[k] or inside:
            false += math.ceil(wrong / (0.5 * RATE))
            wrong = 0
        elif truth.codes[k] == STILL:
            wrong += 1
    return found, false


intervals_of_time = st.lists(
    st.tuples(st.integers(0, 999), st.integers(1, 200)).map(
        lambda pair: (pair[0] / RATE, min(sum(pair), 1000) / RATE)
    ),
    max_size=6,
)


class TestImpacts:
    """A blow at 3.0 to 3.1 s, far from the only slip at 5 s, if nothing else is said."""

    @pytest.mark.parametrize(
        ("raised", "blows", "expected"),
        [
            ((), [(3.0, 3.1)], (1, 0.0)),
            ([(3.05, 3.2)], [(3.0, 3.1)], (1, 1.0)),
            ([(3.05, 3.06), (3.1, 3.11)], [(3.0, 3.1)], (1, 1.0)),  # two alarms for one blow
            ([(3.34, 3.4)], [(3.0, 3.1)], (1, 1.0)),
            ([(3.37, 3.4)], [(3.0, 3.1)], (1, 0.0)),  # over 0.25 s after its end
            ([(2.9, 3.2)], [(3.0, 3.1)], (1, 1.0)),  # a raised flag gains nothing
            ([(3.05, 3.1)], [(1.0, 1.0), (2.0, 2.2), (3.0, 3.1), (8.0, 8.1)], (4, 0.25)),
            ([(4.7, 4.8)], [(4.6, 4.7)], None),  # it comes near a slip
            ([(4.3, 4.4)], [(4.2, 4.3)], None),  # so do the alarms that are its own
            ((), [], None),
        ],
    )
    def test_alarms_for_a_blow(self, raised, blows, expected):
        given = decisions(raised, [slip()])
        given = replace(given, truth=replace(given.truth, impacts=tuple(blows)))
        metrics = slip_metrics(count_slips(given)).impacts
        assert (metrics and (metrics.n, metrics.false_alarms_per_impact)) == expected

    def test_a_finger_that_does_not_hold_feels_none(self):
        codes = np.full(1000, STILL, dtype=np.int8)
        codes[305:] = NOT_HELD
        given = decisions([(3.0, 3.02)], codes=codes)
        truth = replace(given.truth, impacts=((3.0, 3.1), (1.0, 1.1)))
        assert slip_metrics(count_slips(replace(given, truth=truth))).impacts.n == 1

    def test_at_many_thresholds_and_in_sums(self):
        given = decisions([(3.05, 3.2)], [slip()])
        given = replace(given, truth=replace(given.truth, impacts=((3.0, 3.1),)))
        curve = SlipCurve.total([slip_curve(given)] * 2)
        assert curve.false_impacts[0] == curve.false_impacts[100] == curve[0].false_impacts == 2
        assert curve.false_impacts[-1] == 0
        assert SlipCounts.total([curve[0], curve[-1]]).n_impacts == 4

    def test_only_truths_with_impacts_show_them(self):
        found = msgspec.to_builtins(slip_metrics(count_slips(decisions([(3.0, 3.1)], [slip()]))))
        assert "impacts" not in found

    def test_of_a_recording(self):
        kinds = np.array(["", "", "tap", "tap", "", "bump"])
        truth = Truth(np.arange(6) / 10, {"impact": kinds}, {})
        assert truth_impacts(truth) == ((0.2, pytest.approx(0.3)), (0.5, 0.5))
        assert truth_impacts(Truth(np.arange(6) / 10, {}, {})) == ()


@given(raised=intervals_of_time, starts=st.lists(st.integers(50, 900), max_size=3, unique=True))
@settings(max_examples=80)
def test_as_the_slow_twin(raised, starts):
    slips = [slip(start / RATE, (start + 20) / RATE) for start in sorted(starts)]
    made = decisions(raised, slips)
    counts = count_slips(made)
    found = int((counts.delays <= 0.1 + 1e-6).sum())
    assert (found, counts.false_held) == naive_counts(made)


def test_the_total_of_halves_is_the_whole():
    first = count_slips(decisions([(5.02, 5.5), (8.0, 8.2)], [slip(gross=5.1)]))
    second = count_slips(decisions([(1.0, 3.0)], [slip(reached=(5.3, math.nan))]))
    total = SlipCounts.total([first, second])
    assert len(total.delays) == 2
    assert total.false_held == first.false_held + second.false_held
    assert slip_metrics(total).incipient["0.1"] == 50
    assert slip_metrics(SlipCounts.total([])).n == 0


def test_auc_of_sliding_against_still():
    made = slip()
    codes = np.full(1000, STILL, dtype=np.int8)
    codes[500:600] = SLIDING
    probability = np.linspace(0.1, 0.2, 1000)
    probability[550:600] = 0.9
    metrics = slip_metrics(count_slips(decisions([], [made], codes=codes, probability=probability)))
    ordered = (probability[codes == SLIDING][:, None] > probability[codes == STILL]).mean()
    assert metrics.auc == pytest.approx(ordered, abs=0.002)


class TestRaised:
    def test_hold_and_end(self):
        times = np.arange(8) / RATE
        probability = np.array([0.1, 0.9, 0.1, 0.1, 0.1, 0.9, 0.0, 0.1])
        made = SlipDecisions(times, probability, times > 0, 0.03, None)
        (raised,) = made.raised_at(np.array([0.5]))
        assert raised.tolist() == [False, True, True, True, False, True, False, False]

    def test_without_an_estimate_nothing_is_raised(self):
        times = np.arange(3) / RATE
        made = SlipDecisions(times, np.full(3, np.nan), times > 0, 1.0, None)
        assert not made.raised_at(np.array([0.5])).any()


def random_recording(seed, n_false):
    """Return decisions with random probabilities: high in a slip and in some still samples."""
    generator = np.random.default_rng(seed)
    made = decisions([], [slip()], seconds=20)
    probability = generator.uniform(0.0, 0.3, len(made.times))
    probability[500:600] = generator.uniform(0.6, 0.95)
    for start in generator.integers(700, 1900, n_false):
        probability[start] = generator.uniform(0.5, 0.9)
    return SlipDecisions(made.times, probability, made.raised, 0.0, made.truth)


class TestThresholds:
    curves = tuple(slip_curve(random_recording(seed, seed % 4)) for seed in range(8))

    def test_the_lowest_that_fits_is_chosen(self):
        total = SlipCurve.total(self.curves)
        place = choose_threshold(total, 1.0)
        rates = [60 * counts.false_held / counts.held_seconds for counts in total]
        assert rates[place] <= 1.0
        assert rates[place - 1] > 1.0
        assert all(rate <= 1.0 for rate in rates[place:])

    def test_false_alarms_are_counted_in_held_time_or_in_quiet_hold_alone(self):
        total = SlipCurve.total(self.curves)
        pushed = replace(total, false_held=total.false_held + 99)
        assert choose_threshold(pushed, 1.0) is None
        place = choose_threshold(pushed, 1.0, "quiet")
        rates = [60 * counts.false_quiet / counts.quiet_seconds for counts in total]
        raised = [counts.raised_seconds / counts.quiet_seconds for counts in total]
        assert rates[place] <= 1.0
        assert rates[place - 1] > 1.0 or raised[place - 1] > 0.02

    def test_a_summary_has_the_threshold_of_other_recordings_or_of_other_groups(self):
        tested, training = (
            [{"thumb": c} for c in part] for part in (self.curves[:4], self.curves[4:])
        )
        for choice in (ThresholdChoice(1.0), ThresholdChoice(-1.0)):  # the second allows nothing
            place = choose_threshold(SlipCurve.total(self.curves[4:]), choice.false_alarms)
            summary = summarise_choice(tested, choice, training=training)
            assert summary.threshold_chosen and summary.intervals is not None
            counts = SlipCurve.total(self.curves[:4])[-1 if place is None else place]
            assert summary.pooled == summary.fingers["thumb"] == slip_metrics(counts)
        groups = [0, 0, 1, 1]
        places = held_out_places(self.curves[:4], groups, ThresholdChoice(1.0))
        counts = SlipCounts.total(c[k] for c, k in zip(self.curves, places, strict=False))
        summary = summarise_choice(tested, ThresholdChoice(1.0), groups=groups)
        assert summary.pooled == slip_metrics(counts)

    def test_a_curve_is_the_counts_at_each_threshold(self):
        slips = [slip(), slip(8.0, 8.3, gross=8.1, reached=(8.05, math.nan))]
        made = replace(
            decisions([], slips, seconds=20),
            probability=random_recording(5, 9).probability,
            hold=0.2,
        )
        for place in (40, 60, 80, 90):
            (raised,) = made.raised_at(SLIP_THRESHOLDS[[place]])
            expected = vars(count_slips(replace(made, raised=raised)))
            counts = vars(slip_curve(made)[place])
            assert raised.any()
            assert {name: np.asarray(value).tolist() for name, value in counts.items()} == {
                name: np.asarray(value).tolist() for name, value in expected.items()
            }

    def test_none_if_no_threshold_fits(self):
        probability = np.ones(1000)
        made = SlipDecisions(
            np.arange(1000) / RATE, probability, probability > 0, 0.0, decisions([]).truth
        )
        assert choose_threshold(slip_curve(made), 1.0) is None

    def test_a_recording_is_scored_by_the_threshold_of_the_others(self):
        places = held_out_places(self.curves, list(range(8)), ThresholdChoice(1.0))
        for own, place in enumerate(places):
            others = [curve for k, curve in enumerate(self.curves) if k != own]
            total = SlipCurve.total(others)
            assert place == choose_threshold(total, 1.0)

    @pytest.mark.parametrize("groups", [range(8), (0, 0, 1, 1, 2, 2, 3, 3)])
    def test_intervals_with_the_choice_are_of_recordings_left_out(self, groups):
        choice = ThresholdChoice(1.0)
        places = held_out_places(self.curves, groups, choice)
        scored = [curve[place] for curve, place in zip(self.curves, places, strict=True)]
        point = slip_metrics(SlipCounts.total(scored))
        held_out = slip_intervals(self.curves, choice, groups=groups, n=200)
        low, high = held_out.false_alarms_per_minute["held"]
        assert low <= point.false_alarms_per_minute["held"] <= high
        assert high > 1.0  # the rate that was asked for holds in sample only
        low, high = held_out.incipient["0.1"]
        assert low <= point.incipient["0.1"] <= high

    def test_a_single_group_gets_the_highest_threshold(self):
        places = held_out_places(self.curves[:2], (0, 0), ThresholdChoice(1.0))
        assert places.tolist() == [len(SLIP_THRESHOLDS) - 1] * 2

    def test_no_threshold_where_nothing_is_held(self):
        codes = np.full(1000, NOT_HELD, dtype=np.int8)
        assert choose_threshold(slip_curve(decisions([], codes=codes)), 1.0) is None

    def test_intervals_without_a_choice_are_those_of_the_threshold(self):
        single = [SlipCurve.of_one(curve[60]) for curve in self.curves]
        found = slip_intervals(single, n=200)
        summary = slip_summary([{"thumb": curve[0]} for curve in single], found)
        low, high = found.incipient["0.1"]
        assert low <= summary.pooled.incipient["0.1"] <= high
        assert summary.intervals == found

    def test_intervals_at_the_threshold_of_training_recordings(self):
        """Equal training recordings give the same threshold in every resample."""
        choice, tested = ThresholdChoice(1.0), self.curves[:4]
        place = choose_threshold(self.curves[5], 1.0)
        found = slip_intervals(tested, choice, training=[self.curves[5]] * 3, n=200)
        assert found == slip_intervals([SlipCurve.of_one(curve[place]) for curve in tested], n=200)
        varied = slip_intervals(tested, choice, training=self.curves[4:], n=200)
        assert varied != found

    def test_no_interval_of_one_recording(self):
        assert slip_intervals(self.curves[:1]) is None

    def test_no_summary_without_slips_that_are_known(self):
        assert slip_summary([{}, {}]) is None
