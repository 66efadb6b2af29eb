from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import (
    Decisions,
    FingerDecisions,
    Metrics,
    event_metrics,
    sample_metrics,
    summarise,
)


def finger(seed, n=400):
    """A finger that is lost twice, and a detector that is sometimes wrong."""
    rng = np.random.default_rng(seed)
    labels = np.repeat([NO_CONTACT, STABLE, UNSTABLE, STABLE, UNSTABLE], n // 5)
    truth = labels == STABLE
    score = np.clip(0.5 + 0.3 * (2 * truth - 1) + rng.normal(0, 0.2, n), 0, 1)
    states = np.where(score > 0.5, STABLE, UNSTABLE)
    states[:20] = UNKNOWN
    times = 0.01 * np.arange(n) + rng.uniform(0, 0.004)
    return FingerDecisions(times, labels, states, np.where(states == UNKNOWN, np.nan, score))


def decisions(seed, names=("thumb", "index")):
    fingers = {name: finger(10 * seed + i) for i, name in enumerate(names)}
    return Decisions.of(f"grasp-{seed}", fingers, 2)


def pooled(fingers):
    columns = ("labels", "states", "stable_probability")
    return sample_metrics(*(np.concatenate([getattr(f, c) for f in fingers]) for c in columns))


def same(one, two):
    assert one.confusion == two.confusion
    assert one.auc == pytest.approx(two.auc, abs=1e-12)
    assert one.brier == pytest.approx(two.brier)


def test_samples_are_pooled_over_fingers_and_recordings():
    each = [decisions(seed) for seed in range(3)]
    metrics = summarise(each, n_resamples=10)
    same(metrics.pooled, pooled([f for d in each for f in d.fingers.values()]))
    for name in ("thumb", "index"):
        same(metrics.fingers[name], pooled([d.fingers[name] for d in each]))
    same(metrics.recordings[1].fingers["index"], pooled([each[1].fingers["index"]]))
    assert [r.name for r in metrics.recordings] == ["grasp-0", "grasp-1", "grasp-2"]


def test_events_of_recordings_add_up():
    each = [decisions(seed) for seed in range(3)]
    metrics = summarise(each, n_resamples=10)
    hands = [event_metrics(d.hand.times, d.hand.labels, d.hand.states) for d in each]
    assert [r.events.hand for r in metrics.recordings] == hands
    assert metrics.events.hand.n_events == sum(hand.n_events for hand in hands)
    n_false = sum(hand.false_alarms["STABLE"] for hand in hands)
    assert metrics.events.hand.false_alarms["STABLE"] == n_false > 0
    assert metrics.events.fingers["thumb"].n_events == 6


def test_events_are_found_in_the_exact_labels_where_they_are_known():
    drawn = decisions(0)
    exact = {n: replace(f, exact_labels=np.roll(f.labels, 10)) for n, f in drawn.fingers.items()}
    known = Decisions.of("known", exact, 2)
    metrics = summarise([known, drawn])
    one, two = (recording.events for recording in metrics.recordings)
    assert (one.hand.onsets, two.hand.onsets, metrics.events.hand.onsets) == (
        "truth", "labels", "mixed",
    )  # fmt: skip
    assert one.fingers["thumb"].onsets == "truth"
    finger = exact["thumb"]
    wanted = event_metrics(finger.times, finger.exact_labels, finger.states)
    assert one.fingers["thumb"].missed == wanted.missed != two.fingers["thumb"].missed
    assert metrics.recordings[0].fingers == metrics.recordings[1].fingers


def test_a_hand_has_exact_labels_only_if_all_fingers_have_them():
    drawn = decisions(0)
    thumb = drawn.fingers["thumb"]
    some = {**drawn.fingers, "thumb": replace(thumb, exact_labels=thumb.labels)}
    assert Decisions.of("some", some, 2).hand.exact_labels is None
    every = {n: replace(f, exact_labels=f.labels) for n, f in drawn.fingers.items()}
    hand = Decisions.of("every", every, 2).hand
    assert hand.exact_labels.tolist() == hand.labels.tolist()


def test_json_has_the_fields_of_the_contract():
    document = msgspec.json.decode(msgspec.json.encode(summarise([decisions(1), decisions(2)])))
    assert {"fingers", "pooled", "recordings", "events"} <= set(document)
    sample = {"n", "accuracy", "fdr", "fpr", "fnr", "auc", "auc_contact", "confusion"}
    sample |= {"without_estimate"}
    assert sample <= set(document["pooled"])
    assert sample <= set(document["recordings"][0]["fingers"]["thumb"])
    event = {"n_events", "stable_minutes", "missed", "delay_median", "delay_p95"}
    assert event | {"false_alarms_per_minute", "onsets"} <= set(document["events"]["hand"])
    assert set(document["events"]["hand"]["missed"]) == {"0.05", "0.1", "0.2"}
    assert set(document["events"]["fingers"]) == {"thumb", "index"}


def test_metrics_come_back_from_json():
    metrics = summarise([decisions(1), decisions(2)])
    assert msgspec.json.decode(msgspec.json.encode(metrics), type=Metrics) == metrics


def test_intervals_hold_their_figures():
    metrics = summarise(decisions(seed) for seed in range(8))
    intervals = metrics.intervals
    assert (intervals.n_recordings, intervals.level) == (8, 0.95)
    for name in ("accuracy", "fdr", "fpr", "fnr", "auc", "auc_contact", "brier"):
        low, high = getattr(intervals, name)
        assert low < getattr(metrics.pooled, name) < high
    hand = metrics.events.hand
    low, high = intervals.hand.false_alarms_per_minute
    assert low <= hand.false_alarms_per_minute <= high
    for post, (low, high) in intervals.hand.missed.items():
        assert low <= hand.missed[post] <= high


def test_one_recording_has_no_intervals():
    assert summarise([decisions(1)]).intervals is None
    assert summarise([]).pooled.n == 0


def unlabelled(name="free"):
    track = finger(3)
    nothing = np.zeros(len(track.times))
    bare = FingerDecisions(track.times, nothing, track.states, track.stable_probability)
    return Decisions.of(name, {"thumb": bare, "index": bare}, 2)


def test_a_recording_without_labels_is_listed_and_counts_nowhere():
    labelled = [decisions(1), decisions(2)]
    one, two = summarise(labelled), summarise([*labelled, unlabelled()])
    assert (two.pooled, two.events, two.intervals) == (one.pooled, one.events, one.intervals)
    assert two.recordings[-1].fingers["thumb"].n == 0
    assert two.recordings[-1].events.hand.false_alarms_per_minute is None
    assert sum(two.recordings[-1].events.hand.false_alarms.values()) == 0


def test_without_a_hand_the_hand_has_no_events():
    metrics = summarise(Decisions(f"{k}", {"thumb": finger(k)}) for k in range(2))
    assert metrics.events.hand.n_events == 0
    assert metrics.events.fingers["thumb"].n_events == 4
    assert metrics.intervals.hand.missed == {"0.05": None, "0.1": None, "0.2": None}
    assert metrics.intervals.accuracy is not None


def test_fingers_may_differ_between_recordings():
    metrics = summarise([decisions(1, ("thumb",)), decisions(2, ("thumb", "ring"))])
    assert list(metrics.fingers) == ["thumb", "ring"]
    assert metrics.fingers["ring"].n == metrics.recordings[1].fingers["ring"].n


@settings(max_examples=10)
@given(st.permutations(range(5)))
def test_the_order_of_recordings_changes_nothing(order):
    one = summarise([decisions(seed) for seed in range(5)], n_resamples=5)
    two = summarise([decisions(seed) for seed in order], n_resamples=5)
    same(one.pooled, two.pooled)
    assert one.events.hand.missed == two.events.hand.missed
    assert one.events.hand.delay_p95 == pytest.approx(two.events.hand.delay_p95)
    assert one.events.hand.false_alarms == two.events.hand.false_alarms
