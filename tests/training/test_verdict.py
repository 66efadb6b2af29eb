"""The sentence on what a model is good for: each of its forms."""

import re

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


def with_false_alarms(every, first=50):
    """Right decisions, and a false alarm every so many samples of stable label."""
    indices = np.arange(len(LABELS))
    wrong = (LABELS == STABLE) & (indices % every == first)
    return np.where(wrong, UNSTABLE, LABELS)


def late(n_events):
    """Decisions that overlook the first events."""
    return np.where(np.arange(len(LABELS)) < 1000 * n_events, STABLE, LABELS)


CALM = np.where(np.arange(12_000) < 5000, UNSTABLE, STABLE)
ALWAYS = np.full(12_000, STABLE)
NEVER = np.full(12_000, UNSTABLE)


@pytest.mark.parametrize(
    ("arguments", "start"),
    [
        ((np.full(12_000, UNKNOWN),), "Not usable: no labelled sample"),
        ((NEVER,), "Not usable: it never"),
        ((ALWAYS,), "Not usable: it always"),
        ((with_false_alarms(1000), np.full(12_000, 0.5)), "Not usable: .*AUC 0.50"),
        ((with_false_alarms(100),), "Not good enough: 60 false alarms .*, 0 % of 12 .* 99 %"),
        ((LABELS, RIGHT, LABELS, 7), "Good for an automatic reaction: at most 0.27 .* 0 % of 84"),
        ((late(2), RIGHT, LABELS, 7), "Good for a person who watches: at most 0.27 .* 17 % of 84"),
        ((late(5),), "Not good enough: at most 1.9 false alarms a minute, 42 % of 12 onsets"),
        (
            (CALM, np.where(CALM == STABLE, 0.9, 0.1), CALM),
            "Not enough data: 0 of 20 events, 1.1 of 10 .* at most 2.6 .* no instability .* 58 %",
        ),
        ((LABELS, RIGHT, NEVER), "Not enough data: 0 of 20 events, 0 of 10 held minutes, 1 of 5"),
    ],
)
def test_what_a_model_is_good_for(arguments, start):
    assert re.match(start, verdict(metrics(*arguments)))


def test_an_accuracy_below_the_commoner_class():
    wrong = np.where(np.arange(12_000) % 1000 < 300, UNSTABLE, LABELS)
    wrong[LABELS == UNSTABLE] = UNSTABLE
    assert "only 70 % of the samples right (always STABLE: 80 %)" in verdict(metrics(wrong))


def test_the_commoner_class_may_be_the_other():
    labels = np.where(np.arange(12_000) % 1000 < 300, STABLE, UNSTABLE)
    found = verdict(metrics(labels, np.where(labels == STABLE, 0.9, 0.1), labels))
    assert "(never STABLE: 70 %)" in found


def test_tares_under_load_are_named():
    found = verdict(metrics(LABELS), LoadedTares(3, 5))
    assert found.endswith("in 3 of 5 recordings: see --tare.")
    assert "tare" not in verdict(metrics(LABELS), LoadedTares(0, 5))


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
        ({}, "Good for an automatic reaction: at most 0.3 false alarms a minute, 0 % of 20"),
        ({"n_events": 12}, "Not enough data: 12 of 20 events: at most 0.3 false alarms"),
        ({"stable_minutes": 9.99}, "Not enough data: 9.9 of 10 held minutes: at most 0.3 false"),
        ({"n_recordings": 4}, "Not enough data: 4 of 5 recordings: at most 0.3 false"),
        (
            {"n_events": 1, "stable_minutes": 0.4, "n_recordings": 1},
            "Not enough data: 1 of 20 events, 0.4 of 10 held minutes, 1 of 5 recordings: at most "
            "7.5 false alarms a minute, 0 % of 1 onset of",
        ),
        (
            {"false_alarms_per_minute": 0.5, "rate_limits": (0.1, 1.2)},
            "Good for a person who watches: 0.5 (up to 1.2) false alarms a minute",
        ),
        (
            {"missed": {"0.2": 5.0}, "missed_limits": (0.0, 15.0)},
            "Good for a person who watches: at most 0.3 false alarms a minute, 5 % (up to 15 %)",
        ),
        (
            {"false_alarms_per_minute": 8.0, "rate_limits": (2.0, 14.0)},
            "Not good enough: 8 (up to 14) false alarms a minute,",
        ),
        ({"n_events": 12, "false_alarms_per_minute": 14.0}, "Not good enough: 14 false alarms"),
        ({"onsets": "rule"}, "Good for an automatic reaction (labels by rule): at most"),
    ],
)
def test_the_rule_of_events(fields, start):
    assert verdict(changed(metrics(LABELS, n=5), **ENOUGH | fields)).startswith(start)


def test_in_sample_stands_in_both_sentences():
    whole = changed(metrics(LABELS, n=5), **ENOUGH, onsets="rule")
    found = verdict(with_slips(slips(onsets="rule"), whole), in_sample=True)
    assert found.startswith("Good for an automatic reaction (in sample, labels by rule): at most")
    assert found.endswith("automatic reaction to slips (in sample, labels by rule).")


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


def slip_sentence(*arguments, **intervals):
    return verdict(with_slips(*arguments, **intervals)).partition(" Slips: ")[2]


@pytest.mark.parametrize(
    ("pooled", "intervals", "use"),
    [
        (slips(), {}, "good for an automatic reaction to slips."),
        (slips(found=90.0, rate=1.5), {}, "good for an automatic reaction to slips."),
        (slips(rate=1.6), {}, "not good enough"),
        (slips(found=89.0), {}, "not good enough"),
        (slips(), {"rate": (0.5, 1.6)}, "not good enough"),
        (slips(), {"found": (80.0, 99.0)}, "not good enough for an automatic reaction to slips: "
         "before 1 mm 95 % (down to 80 %), 90 % needed at 1.5 false alarms a minute."),
        (slips(n=19), {}, "not enough data: 19 of 20 slips over 1 mm."),
        (slips(minutes=9.0), {}, "not enough data: 9 of 10 held minutes."),
        (slips(onsets="labels"), {}, "good for an automatic reaction to slips."),
        (slips(onsets="rule"), {}, "good for an automatic reaction to slips (labels by rule)."),
        (slips(n=19, onsets="labels"), {}, "not enough data: 19 of 20 slips."),
        (slips(found=80.0, onsets="labels"), {}, "not good enough"),
    ],
)  # fmt: skip
def test_what_slips_are_good_for(pooled, intervals, use):
    assert slip_sentence(pooled, **intervals).split("; ")[1].startswith(use)


def test_a_model_that_reports_no_slip_ranks():
    found = verdict(with_slips(slips(found=0.0, rate=0.0)), reports_slips=False)
    assert "holdfast calibrate" in found and found.endswith("0.90.")


def test_the_sentence_about_slips():
    found = slip_sentence(slips(found=35.0), rate=(0.5, 1.4))
    assert found.startswith("35 % of 40 slips of fingers found within 0.1 s, 1 (up to 1.4) false")
    assert " (by labels) found within 0.1 s" in slip_sentence(slips(onsets="labels"))
    assert "at most 0.3 false alarms" in slip_sentence(slips(n=0, rate=0.0))


@pytest.mark.parametrize(
    ("value", "upper", "text"),
    [
        (156.0, 370.4, "156 (up to 370) false alarms a minute"),
        (0.73, 1.46, "0.73 (up to 1.5) false alarms a minute"),
        (0.0, 120.0, "at most 120 false alarms a minute"),
    ],
)
def test_a_large_rate_has_no_exponent(value, upper, text):
    assert Bounded(value, upper).alarms() == text
