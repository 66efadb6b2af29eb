"""The word on what a model is worth, and its numbers."""

import msgspec
import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import Decisions, FingerDecisions, summarise
from holdfast.metrics.slip_curves import SlipIntervals, SlipSummary
from holdfast.metrics.slips import SlipMetrics
from holdfast.training.verdict import Bounded, LoadedTares, verdict

TIMES = np.arange(12_000) * 0.01
LABELS = np.where(np.arange(12_000) % 1000 < 800, STABLE, UNSTABLE)
"""Two minutes: twelve times 8 s stable and 2 s unstable."""
RIGHT = np.where(LABELS == STABLE, 0.9, 0.1)


def metrics(states, probability=RIGHT, labels=LABELS, n=1, **exact):
    """Metrics of so many equal recordings."""
    probability = np.where(states == UNKNOWN, np.nan, probability)
    finger = FingerDecisions(TIMES, labels, np.asarray(states, dtype=np.int8), probability, **exact)
    return summarise([Decisions.of(f"{k}", {"thumb": finger}, 1) for k in range(n)])


def test_tares_under_load_are_named():
    found = verdict(metrics(LABELS), LoadedTares(3, 5))
    assert found.endswith(" Tare taken under load in 3 of 5 recordings: see --tare.")
    assert "Tare" not in verdict(metrics(LABELS), LoadedTares(0, 5))


def changed(whole, n_recordings=5, **fields):
    """Metrics of five recordings with other counts, rates and intervals of the hand."""
    replace, hand = msgspec.structs.replace, whole.events.hand
    limits = {name: fields.pop(name) for name in ("rate_limits", "missed_limits") if name in fields}
    intervals = replace(
        whole.intervals.hand,
        false_alarms_per_minute=limits.get("rate_limits", (0.0, 0.0)),
        missed={"0.2": limits.get("missed_limits", (0.0, 0.0))},
    )
    return replace(
        whole,
        recordings=whole.recordings[:n_recordings],
        events=replace(whole.events, hand=replace(hand, **fields)),
        intervals=replace(whole.intervals, hand=intervals),
    )


ENOUGH = {"n_events": 20, "stable_minutes": 10.0}


@pytest.mark.parametrize(
    ("fields", "start"),
    [
        ({}, "good: at most 0.3 false alarms a minute, 0 % missed within 0.2 s; onsets: 20, held"),
        ({"n_events": 12}, "not enough data (12 of 20 onsets): at most 0.3 false alarms"),
        ({"stable_minutes": 9.99}, "not enough data (9.9 of 10 held minutes): at most 0.3 false"),
        ({"n_recordings": 4}, "not enough data (4 of 5 recordings): at most 0.3 false"),
        (
            {"false_alarms_per_minute": 0.5, "rate_limits": (0.1, 1.2)},
            "usable: 0.5 (up to 1.2) false alarms a minute",
        ),
        (
            {"missed": {"0.2": 5.0}, "missed_limits": (0.0, 15.0)},
            "usable: at most 0.3 false alarms a minute, 5 (up to 15) % missed",
        ),
        (
            {"false_alarms_per_minute": 8.0, "rate_limits": (2.0, 14.0)},
            "weak: 8 (up to 14) false alarms a minute,",
        ),
        ({"n_events": 12, "false_alarms_per_minute": 14.0}, "weak: 14 false alarms"),
        ({"onsets": "rule"}, "good (labels by rule): at most"),
    ],
)
def test_the_rule_of_events(fields, start):
    found = verdict(changed(metrics(LABELS, n=5), **ENOUGH | fields))
    assert found.startswith(f"Stability: {start}")


def test_in_sample_stands_at_both():
    whole = changed(metrics(LABELS, n=5), **ENOUGH, onsets="rule")
    found = verdict(with_slips(slips(onsets="rule"), whole), in_sample=True)
    assert found.startswith("Stability: good (in sample, labels by rule): at most")
    assert " Slips: good (in sample, by labels of a rule): 1 false" in found


def slips(n=40, found=95.0, rate=1.0, onsets="truth", minutes=10.0):
    shares = {"before": 0.0, "0.03": 0.0, "0.05": 0.0, "0.1": found if n else None}
    known = onsets == "truth" and n
    return SlipMetrics(
        n=n, n_over_1mm=n if known else 0, n_gross=0, incipient=shares, gross={}, over_1mm=shares,
        before_1mm=found if known else None, before_3mm=None, raised_quiet=0.0,
        false_alarms_per_minute={"quiet": 0.0, "held": rate}, auc=0.9, quiet_minutes=5.0,
        held_minutes=minutes, onsets=onsets,
    )  # fmt: skip


def with_slips(pooled, whole=None, found=None, rate=None):
    """Metrics of five recordings with these slips, and the intervals of shares and rate."""
    whole = metrics(LABELS, n=5) if whole is None else whole
    shares = dict.fromkeys(("before", "0.03", "0.05", "0.1"), found)
    limits = SlipIntervals(shares, {}, shares, found, None, None, {"quiet": None, "held": rate})
    return msgspec.structs.replace(whole, slips=SlipSummary({}, pooled, limits))


@pytest.mark.parametrize(
    ("pooled", "intervals", "line"),
    [
        (slips(), {}, "good: 1 false alarms a minute, 5 % missed before 1 mm; slips over 1 mm: "
         "40, held minutes: 10."),
        (slips(found=90.0, rate=1.5), {}, "good: "),
        (slips(rate=1.6), {}, "usable: "),
        (slips(found=50.0, rate=3.0), {}, "usable: "),
        (slips(found=49.0), {}, "weak: "),
        (slips(rate=3.1), {}, "weak: "),
        (slips(), {"rate": (0.5, 1.6)}, "usable: 1 (up to 1.6) false alarms a minute"),
        (slips(), {"found": (40.0, 99.0)}, "weak: 1 false alarms a minute, 5 (up to 60) % missed"),
        (slips(n=19), {}, "not enough data (19 of 20 slips over 1 mm): "),
        (slips(minutes=9.0), {}, "not enough data (9 of 10 held minutes): "),
        (slips(n=0, rate=0.0), {}, "not enough data (0 of 20 slips over 1 mm): at most 0.3 false"),
        (slips(onsets="labels"), {}, "good (by labels): 1 false alarms a minute, 5 % missed within "
         "0.1 s; slips: 40, held"),
        (slips(n=19, onsets="labels"), {}, "not enough data (19 of 20 slips, by labels): "),
    ],
)  # fmt: skip
def test_what_slips_are_worth(pooled, intervals, line):
    found = verdict(with_slips(pooled, **intervals)).partition(" Slips: ")[2]
    assert found.startswith(line)


def test_a_model_that_reports_no_slip_ranks():
    found = verdict(with_slips(slips(found=0.0, rate=0.0)), reports_slips=False)
    assert "holdfast calibrate" in found and found.endswith("0.90.")


@pytest.mark.parametrize(
    ("value", "upper", "text"),
    [
        (156.0, 370.4, "156 (up to 370)"),
        (0.73, 1.46, "0.73 (up to 1.5)"),
        (0.0, 120.0, "at most 120"),
    ],
)
def test_a_large_rate_has_no_exponent(value, upper, text):
    assert Bounded(value, upper).text() == text
