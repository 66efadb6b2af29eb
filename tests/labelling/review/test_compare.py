import json
import math
import warnings
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import cohen_kappa_score

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.labelling.review.compare import Span, cohens_kappa, compare, pool
from holdfast.recordings import Label, label_states, labels_from_samples

STATES = (None, ContactState.NO_CONTACT, ContactState.UNSTABLE, ContactState.STABLE)
LETTERS = dict(zip(" nus", STATES, strict=True))


def drawn(text, step=1.0, start=0.0):
    """Labels out of one letter a sample: n, u, s, or a space for none."""
    times = start + step * np.arange(len(text))
    states = [None if c == " " else (LETTERS[c], None) for c in text]
    return labels_from_samples(times, states, period=step)


PAIRS = st.lists(st.tuples(st.sampled_from(" nus"), st.sampled_from(" nus")), min_size=1).filter(
    lambda pairs: any(pair != (" ", " ") for pair in pairs)
)


def of(a, b, step=1.0):
    n = max(len(a), len(b))
    times = {"thumb": step * np.arange(n)}
    return compare({"thumb": drawn(a, step)}, {"thumb": drawn(b, step)}, times).fingers["thumb"]


def sklearn_kappa(a, b):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cohen_kappa_score(a, b)


@given(PAIRS)
def test_kappa_is_that_of_scikit_learn_over_what_both_label(pairs):
    a, b = ("".join(each) for each in zip(*pairs, strict=True))
    found = of(a, b)
    both = [pair for pair in pairs if " " not in pair]
    assert found.n == len(both) == sum(map(sum, found.confusion))
    for kappa, codes in (
        (found.kappa, both),
        (found.kappa_stable, [(x == "s", y == "s") for x, y in both]),
    ):
        expected = sklearn_kappa(*zip(*codes, strict=True)) if codes else math.nan
        assert kappa == pytest.approx(expected) if not math.isnan(expected) else kappa is None


@given(PAIRS)
def test_exchanging_a_and_b_exchanges_the_results(pairs):
    a, b = ("".join(each) for each in zip(*pairs, strict=True))
    one, two = of(a, b), of(b, a)
    assert (one.kappa, one.kappa_stable, one.n) == (two.kappa, two.kappa_stable, two.n)
    assert (one.only_a, one.missing_in_a) == (two.only_b, two.missing_in_b)
    assert sorted(one.onset_differences.values) == sorted(-x for x in two.onset_differences.values)


def test_kappa_of_cohens_own_kind_of_table():
    assert cohens_kappa([[20, 5], [10, 15]]) == 0.4
    assert cohens_kappa([[0, 5], [5, 0]]) == -1.0


def test_counts_do_not_overflow():
    assert cohens_kappa([[2**33, 0], [0, 2**33]]) == 1.0


def test_samples_that_only_one_labels_are_ignored_by_kappa():
    found = of("ssuu    ", "  uuss  ")
    assert found.confusion == [[0, 0, 0], [0, 2, 0], [0, 0, 0]]
    assert (found.only_a, found.only_b, found.n, found.n_samples) == (0.25, 0.25, 2, 8)


def test_onsets_are_matched_in_time():
    found = of("sssssuuuussssssssssuuu", "sssssssuuussssssssuuuu", step=0.1).onset_differences
    assert found.values == pytest.approx([0.2, -0.1])
    assert (found.n, found.only_a, found.only_b) == (2, 0, 0)
    assert found.median == pytest.approx(0.05)
    assert found.p95 == pytest.approx(0.195)


def test_an_onset_over_half_a_second_away_is_another():
    at = of("sss" + "u" * 12, "ssssssss" + "u" * 7, step=0.1).onset_differences
    assert (at.n, at.values) == (1, pytest.approx([0.5]))
    beyond = of("sss" + "u" * 12, "sssssssss" + "u" * 6, step=0.1).onset_differences
    assert (beyond.n, beyond.only_a, beyond.only_b) == (0, 1, 1)
    assert (beyond.median, beyond.p95) == (None, None)


def test_as_many_onsets_as_possible_are_matched():
    """The nearest pair first would leave the two others alone."""
    a = [*held(0.0, 1.0, 1.2), *held(1.2, 1.4, 1.6)]
    b = [*held(0.0, 1.35, 1.5), *held(1.5, 1.8, 2.0)]
    times = {"thumb": np.arange(200) * 0.01}
    found = compare({"thumb": a}, {"thumb": b}, times).fingers["thumb"].onset_differences
    assert found.values == pytest.approx([0.35, 0.4])


def held(start, onset, end):
    return Label(start, onset, ContactState.STABLE), Label(onset, end, ContactState.UNSTABLE)


def test_a_gap_in_the_labels_hides_an_onset():
    near = Label(0.0, 0.95, ContactState.STABLE), Label(1.05, 2.0, ContactState.UNSTABLE)
    far = Label(0.0, 0.9, ContactState.STABLE), Label(1.05, 2.0, ContactState.UNSTABLE)
    times = {"thumb": np.arange(200) * 0.01}
    found = compare({"thumb": near}, {"thumb": far}, times).fingers["thumb"].onset_differences
    assert (found.n, found.only_a, found.only_b) == (0, 1, 0)


def test_release_is_an_onset_and_closing_is_not():
    found = of("uussnn", "uussnn").onset_differences
    assert (found.n, found.values) == (1, [0.0])


def test_intervals_that_only_one_has():
    found = of("nnsssusssnn", "nnsssssssnn")
    assert found.missing_in_b == [Span(5.0, 6.0, "unstable")]
    assert found.missing_in_a == []


def test_touching_labels_of_one_state_are_one_interval():
    one = [Label(0.0, 1.0, ContactState.STABLE), Label(1.0, 2.0, ContactState.STABLE)]
    found = compare({"thumb": one}, {"thumb": []}, {"thumb": np.arange(4) * 0.5}, "can")
    assert found.fingers["thumb"].missing_in_b == [Span(0.0, 2.0, "stable")]


def test_intervals_that_only_touch_are_no_counterparts():
    found = of("uuss", "ssuu")
    assert [span.state for span in found.missing_in_a] == ["stable", "unstable"]


def test_fingers_without_labels_are_left_out():
    times = {name: np.arange(3.0) for name in ("thumb", "index", "ring")}
    found = compare({"thumb": drawn("sus")}, {"index": drawn("sus"), "ring": ()}, times)
    assert list(found.fingers) == ["thumb", "index"]
    assert (found.fingers["thumb"].only_a, found.fingers["index"].only_b) == (1.0, 1.0)
    assert found.fingers["thumb"].kappa is None


def test_fingers_have_their_own_times():
    times = {"thumb": np.arange(4.0), "index": np.arange(8) * 0.5}
    labels = {"thumb": drawn("ssuu"), "index": drawn("ssuu")}
    found = compare(labels, labels, times)
    assert {name: each.n for name, each in found.fingers.items()} == {"thumb": 4, "index": 8}


def test_labels_may_come_in_any_order():
    times = {"thumb": np.arange(4.0)}
    upset = {"thumb": drawn("ssuu")[::-1]}
    assert compare(upset, {"thumb": drawn("ssuu")}, times).fingers["thumb"].kappa == 1.0


def test_a_finger_that_the_recording_does_not_have():
    with pytest.raises(RecordingError) as error:
        compare({"pinky": drawn("s")}, {}, {"thumb": np.arange(2.0)}, "can")
    assert str(error.value) == "labels for pinky given; recording 'can' has thumb"


@given(st.lists(st.text("nus ", min_size=4, max_size=4), min_size=2, max_size=6))
def test_pooled_agreement_is_that_of_one_long_recording(texts):
    times = {"thumb": np.arange(4.0)}
    pairs = list(pairwise(texts))
    parts = [compare({"thumb": drawn(a)}, {"thumb": drawn(b)}, times) for a, b in pairs]
    pooled = pool(parts).pooled
    joined = [
        np.concatenate([label_states(drawn(text), times["thumb"]) for text in side])
        for side in zip(*pairs, strict=True)
    ]
    both = (joined[0] > 0) & (joined[1] > 0)
    expected = sklearn_kappa(joined[0][both], joined[1][both]) if both.any() else math.nan
    if math.isnan(expected):
        assert pooled.kappa is None
    else:
        assert pooled.kappa == pytest.approx(expected)
    labelled = (joined[0] > 0) | (joined[1] > 0)
    assert pooled.n == both.sum()
    assert pooled.only_a * pooled.n_samples == pytest.approx((labelled & (joined[1] == 0)).sum())


def test_pooled_by_finger_and_over_all():
    times = {"thumb": np.arange(4.0), "index": np.arange(4.0)}
    parts = [
        compare({"thumb": drawn("ssuu")}, {"thumb": drawn("suuu")}, times, "one"),
        compare({"index": drawn("ssuu")}, {"index": drawn("ssuu")}, times, "two"),
    ]
    found = pool(parts)
    assert list(found.fingers) == ["thumb", "index"]
    assert (found.fingers["thumb"].n, found.pooled.n) == (4, 8)
    onsets = found.pooled.onset_differences
    assert (onsets.values, onsets.only_a, onsets.only_b) == ([0.0], 1, 1)
    assert found.pooled.n_missing_in_a == 0


def test_pooled_of_nothing():
    pooled = pool([]).pooled
    assert (pooled.kappa, pooled.n, pooled.only_a) == (None, 0, 0.0)


def caused(*parts):
    """Unstable labels from (start, end, cause)."""
    return [Label(start, end, "UNSTABLE", cause) for start, end, cause in parts]


def test_causes_are_counted_by_sample_where_both_have_one():
    a = caused((0, 2, "disturbance"), (2, 5, "slip"), (5, 8, "disturbance"), (8, 9, None))
    b = caused((0, 3, "disturbance"), (3, 5, "slip"), (5, 6, None), (6, 9, "disturbance"))
    part = compare({"thumb": a}, {"thumb": b}, {"thumb": np.arange(10.0)})
    found = part.fingers["thumb"]
    disturbance, slip = list(Cause).index("disturbance"), list(Cause).index("slip")
    causes = np.array(found.causes)
    assert causes[[disturbance, slip]][:, [disturbance, slip]].tolist() == [[4, 0], [1, 2]]
    assert causes.sum() == 7
    codes = [0, 0, 1, 1, 1, 0, 0], [0, 0, 0, 1, 1, 0, 0]
    assert found.kappa_cause == pytest.approx(cohen_kappa_score(*codes))
    assert (found.kappa, found.n) == (None, 9)  # of one state, for kappa of the states
    assert pool([part, part]).pooled.causes == (2 * causes).tolist()
    assert pool([part, part]).pooled.kappa_cause == found.kappa_cause


def test_without_causes_there_is_no_kappa_of_causes():
    found = of("ssuu", "ssuu")
    assert np.sum(found.causes) == 0
    assert found.kappa_cause is None


def test_the_json_document():
    times = {"thumb": np.arange(4.0)}
    part = compare({"thumb": drawn("ssnn")}, {"thumb": drawn("ssss")}, times, "can")
    document = json.loads(msgspec.json.encode(pool([part])))
    thumb = document["recordings"][0]["fingers"]["thumb"]
    assert document["recordings"][0]["name"] == "can"
    assert (thumb["kappa"], thumb["kappa_stable"], thumb["n"]) == (0.0, 0.0, 4)
    assert thumb["missing_in_b"] == [{"start": 2.0, "end": 4.0, "state": "no_contact"}]
    assert thumb["onset_differences"]["median"] is None
    assert set(document) == {"recordings", "fingers", "pooled"}
