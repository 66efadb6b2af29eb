"""Score of decisions about slips: the protocol of DESIGN, by hand and by a slow twin."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.metrics.slip_curves import slip_curve
from holdfast.metrics.slip_truth import (
    CREEPING,
    NOT_HELD,
    SLIDING,
    STILL,
    SlipDecisions,
)
from holdfast.metrics.slips import SlipCounts, count_slips, slip_metrics

from .slips import RATE, decisions, slip


def test_the_share_of_unknown_time_is_that_of_labels():
    made = decisions([], seconds=10.0)
    codes = np.repeat([NOT_HELD, STILL, SLIDING, CREEPING], [200, 500, 100, 200]).astype(np.int8)
    truth = replace(made.truth, codes=codes, onsets="labels")
    assert slip_metrics(count_slips(replace(made, truth=truth))).unknown == pytest.approx(25.0)
    by_truth = replace(truth, onsets="truth")
    assert slip_metrics(count_slips(replace(made, truth=by_truth))).unknown is None


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

    def test_what_is_not_held_does_not_count(self):
        codes = np.full(1000, STILL, dtype=np.int8)
        codes[500:] = NOT_HELD
        counts = count_slips(decisions([(6.0, 9.0)], codes=codes))
        assert counts.false_held == 0
        assert counts.held_seconds == pytest.approx(5.0)

    @given(st.floats(0.5, 9.0))
    @settings(max_examples=20)
    def test_a_flag_that_is_always_raised_has_two_a_second(self, onset):
        counts = count_slips(decisions([(0.0, 10.0)], [slip(onset, onset + 0.5)]))
        assert counts.false_held >= 2 * counts.held_seconds - 1e-6
        assert counts.false_held <= 2 * counts.held_seconds + 2

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
        curve = SlipCounts.total([slip_curve(given)] * 2)
        assert curve.false_impacts[0] == curve.false_impacts[100] == curve[0].false_impacts == 2
        assert curve.false_impacts[-1] == 0
        assert SlipCounts.total([curve[0], curve[-1]]).n_impacts == 4

    def test_only_truths_with_impacts_show_them(self):
        found = msgspec.to_builtins(slip_metrics(count_slips(decisions([(3.0, 3.1)], [slip()]))))
        assert "impacts" not in found


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
