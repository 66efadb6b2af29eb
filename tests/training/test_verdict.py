"""The sentence on what a model is good for: each of its forms."""

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import Decisions, FingerDecisions, summarise
from holdfast.metrics.slips import SlipMetrics
from holdfast.training.verdict import LoadedTares, verdict, verdict_of_events, verdict_of_slips

TIMES = np.arange(12_000) * 0.01
LABELS = np.where(np.arange(12_000) % 1000 < 800, STABLE, UNSTABLE)
"""Two minutes: twelve times 8 s stable and 2 s unstable."""
RIGHT = np.where(LABELS == STABLE, 0.9, 0.1)


def metrics(states, probability=RIGHT, labels=LABELS):
    probability = np.where(states == UNKNOWN, np.nan, probability)
    finger = FingerDecisions(TIMES, labels, np.asarray(states, dtype=np.int8), probability)
    return summarise([Decisions.of("one", {"thumb": finger}, 1)])


def with_false_alarms(every, first=50):
    """Right decisions, and a false alarm every so many samples of stable label."""
    places = np.arange(len(LABELS))
    wrong = (LABELS == STABLE) & (places % every == first)
    return np.where(wrong, UNSTABLE, LABELS)


def late(n_events):
    """Decisions that overlook the first events."""
    return np.where(np.arange(len(LABELS)) < 1000 * n_events, STABLE, LABELS)


def test_a_model_without_decisions():
    assert verdict(metrics(np.full(12_000, UNKNOWN))) == (
        "Not usable: no labelled sample has a decision (tare, warm-up, gaps or faults)."
    )


def test_a_model_that_is_never_stable():
    found = verdict(metrics(np.full(12_000, UNSTABLE)))
    assert found == "Not usable: it never says STABLE."


def test_a_model_that_is_always_stable_is_not_praised():
    found = verdict(metrics(np.full(12_000, STABLE)))
    assert found == "Not usable: it always says STABLE."


def test_a_model_like_chance():
    found = verdict(metrics(with_false_alarms(1000), np.full(12_000, 0.5)))
    assert found == ("Not usable: it orders stable and unstable samples like chance (AUC 0.50).")


def test_a_threshold_with_many_false_alarms():
    found = verdict(metrics(with_false_alarms(100)))
    assert found == (
        "Not good enough: 60 false alarms a minute at this threshold (see holdfast tune); 99 % of "
        "the samples right (always STABLE: 80 %)."
    )


def test_a_good_model():
    assert verdict(metrics(LABELS)) == (
        "Good for an automatic reaction: 0.0 false alarms a minute, 0 % of 12 onsets of "
        "instability missed within 0.2 s; 100 % of the samples right (always STABLE: 80 %)."
    )


def test_a_model_for_a_person_who_watches():
    found = verdict(metrics(late(2)))
    assert found.startswith("Good for a person who watches: 0.0 false alarms a minute, 17 % of 12")


def test_a_model_that_misses_events():
    assert verdict(metrics(late(5))).startswith(
        "Not good enough: 0.0 false alarms a minute, 42 % of 12 onsets"
    )


def test_an_accuracy_below_the_commoner_class():
    wrong = np.where(np.arange(12_000) % 1000 < 300, UNSTABLE, LABELS)
    wrong[LABELS == UNSTABLE] = UNSTABLE
    assert "only 70 % of the samples right (always STABLE: 80 %)" in verdict(metrics(wrong))


def test_the_commoner_class_may_be_the_other():
    labels = np.where(np.arange(12_000) % 1000 < 300, STABLE, UNSTABLE)
    found = verdict(metrics(labels, np.where(labels == STABLE, 0.9, 0.1), labels))
    assert "(never STABLE: 70 %)" in found


def test_recordings_without_events():
    labels = np.where(np.arange(12_000) < 5000, UNSTABLE, STABLE)
    found = verdict(metrics(labels, np.where(labels == STABLE, 0.9, 0.1), labels))
    assert found == (
        "No event to judge by: 0.0 false alarms a minute, no instability after a stable hold in "
        "these recordings; 100 % of the samples right (always STABLE: 58 %)."
    )


def test_tares_under_load_are_named():
    found = verdict(metrics(LABELS), LoadedTares(3, 5))
    assert found.endswith("80 %); tare taken under load in 3 of 5 recordings: see --tare.")
    assert "tare" not in verdict(metrics(LABELS), LoadedTares(0, 5))


@pytest.mark.parametrize(
    ("states", "text"),
    [
        (
            LABELS,
            "Good for an automatic reaction: 0.0 false alarms a minute, 0 % of 12 onsets of "
            "instability missed within 0.2 s.",
        ),
        (
            late(5),
            "Not good enough: 0.0 false alarms a minute, 42 % of 12 onsets of instability missed "
            "within 0.2 s.",
        ),
    ],
)
def test_events_alone(states, text):
    assert verdict_of_events(metrics(states).events.hand) == text


def slips(n=40, found=95.0, rate=1.0, onsets="truth"):
    shares = {"before": 0.0, "0.03": 0.0, "0.05": 0.0, "0.1": found if n else None}
    known = onsets == "truth" and n
    return SlipMetrics(
        n=n, n_over_1mm=n if known else 0, n_gross=0, incipient=shares, gross={}, over_1mm=shares,
        before_1mm=found if known else None, before_3mm=None, raised_quiet=0.0,
        false_alarms_per_minute={"quiet": 0.0, "held": rate}, auc=0.9, quiet_minutes=5.0,
        held_minutes=9.0, onsets=onsets,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("metrics", "use"),
    [
        (slips(), "good for an automatic reaction to slips"),
        (slips(found=90.0, rate=1.5), "good for an automatic reaction to slips"),
        (slips(rate=1.6), "not good enough"),
        (slips(found=89.0), "not good enough"),
        (slips(n=19), "too few to judge an automatic reaction (19 of 20 needed)"),
        (slips(onsets="labels"), "good for an automatic reaction to slips"),
        (slips(found=80.0, onsets="labels"), "not good enough"),
    ],
)
def test_what_slips_are_good_for(metrics, use):
    assert verdict_of_slips(metrics).split("; ")[1].startswith(use)


def test_the_sentence_about_slips():
    assert verdict_of_slips(slips(found=35.0)) == (
        "Slips: 35 % of 40 slips of fingers found within 0.1 s at 1 false alarms a minute of held "
        "time; not good enough for an automatic reaction to slips (before 1 mm: 35 %, 90 % needed "
        "at 1.5 false alarms a minute)."
    )
    assert " (by labels) found within 0.1 s" in verdict_of_slips(slips(onsets="labels"))
    assert verdict_of_slips(slips(n=0)) == (
        "Slips: none in these recordings, at 1 false alarms a minute of held time."
    )
