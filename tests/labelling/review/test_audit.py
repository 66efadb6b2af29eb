import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.errors import TrainingError
from holdfast.features import DEPLOYED_FEATURES, parse_features
from holdfast.labelling.review.audit import (
    Audit,
    LabelledFinger,
    Suspect,
    audit,
    default_setting,
    suspects,
)
from holdfast.recordings import Label, Recording, Tactile
from holdfast.training import Setting
from labelling.tiny import TINY, tiny_recording

NONE, UNSTABLE, STABLE = (
    ContactState.NO_CONTACT,
    ContactState.UNSTABLE,
    ContactState.STABLE,
)
TIMES = np.arange(1000) / 100.0


def codes_of(*spans, first=STABLE):
    """Codes by sample: the first state, and others in those spans (start, end, state)."""
    codes = np.full(len(TIMES), first.code)
    for start, end, state in spans:
        codes[np.searchsorted(TIMES, start - 1e-9) : np.searchsorted(TIMES, end - 1e-9)] = (
            state.code
        )
    return codes


def labelled(labels, seen, *, name="one", finger="thumb", sure=0.9):
    """Labels as codes, and probabilities that are sure of other codes."""
    cuts = [0, *(np.flatnonzero(np.diff(labels)) + 1).tolist(), len(labels)]
    each = [
        Label(start / 100, end / 100, list(ContactState)[labels[start]])
        for start, end in zip(cuts[:-1], cuts[1:], strict=True)  # noqa: RUF007 (as slices)
    ]
    probabilities = np.full((len(seen), 3), (1 - sure) / 2)
    probabilities[np.arange(len(seen)), seen - 1] = sure
    return LabelledFinger(name, finger, each, TIMES, 0.01, probabilities)


def calm(name="calm", finger="thumb"):
    """A recording in which all is well, with every kind of edge."""
    codes = codes_of(
        (0, 1, NONE), (1, 2, UNSTABLE), (5, 6, UNSTABLE), (8, 9, UNSTABLE), (9, 10, NONE)
    )
    return labelled(codes, codes, name=name, finger=finger, sure=0.8)


def suspects_in(labels, seen, **more):
    others = [calm(f"calm {k}") for k in range(3)]
    return suspects([labelled(labels, seen, **more), *others])


def test_labels_that_fit_are_not_suspect():
    assert suspects([calm("a"), calm("b")]) == []


def test_an_interval_within_a_label():
    (found,) = suspects_in(codes_of(), codes_of((3.0, 3.4, UNSTABLE)))
    assert found == Suspect(
        "one", "thumb", "interval", 3.0, 3.4, "stable", "unstable", pytest.approx(0.9), None
    )
    assert found.weight == pytest.approx(0.36)


def test_a_whole_label_that_is_wrong():
    (found,) = suspects_in(codes_of((3.0, 3.4, NONE)), codes_of())
    assert (found.kind, found.start, found.end) == ("interval", 3.0, 3.4)
    assert (found.given, found.expected) == ("no_contact", "stable")


def test_short_contradictions_are_ignored():
    assert suspects_in(codes_of(), codes_of((3.0, 3.04, UNSTABLE))) == []
    assert len(suspects_in(codes_of(), codes_of((3.0, 3.05, UNSTABLE)))) == 1


def test_short_gaps_are_closed():
    spans = [(3.0, 3.1, UNSTABLE), (3.14, 3.3, UNSTABLE)]
    (found,) = suspects_in(codes_of(), codes_of(*spans))
    assert (found.start, found.end) == (3.0, 3.3)
    apart = [(3.0, 3.1, UNSTABLE), (3.15, 3.3, UNSTABLE)]
    assert [(s.start, s.end) for s in suspects_in(codes_of(), codes_of(*apart))] == [
        (3.15, 3.3),
        (3.0, 3.1),
    ]


def test_contradictions_for_different_states_are_separate():
    spans = [(3.0, 3.4, UNSTABLE), (3.4, 4.0, NONE)]
    found = suspects_in(codes_of(), codes_of(*spans))
    assert [(s.expected, s.start, s.end) for s in found] == [
        ("no_contact", 3.4, 4.0),
        ("unstable", 3.0, 3.4),
    ]


@pytest.mark.parametrize("shift", [-0.3, -0.15, 0.15, 0.3])
def test_an_edge_that_is_drawn_elsewhere(shift):
    """The label ends at 4 s; the contact is lost `shift` later."""
    (found,) = suspects_in(codes_of((4.0, 10.0, UNSTABLE)), codes_of((4.0 + shift, 10.0, UNSTABLE)))
    assert found.kind == "edge"
    assert found.shift == pytest.approx(shift)
    assert (found.start, found.end) == pytest.approx(sorted((4.0, 4.0 + shift)))
    states = ("stable", "unstable") if shift < 0 else ("unstable", "stable")
    assert (found.given, found.expected) == states
    assert found.confidence == pytest.approx(0.9)


def test_small_shifts_of_an_edge_are_ignored():
    assert suspects_in(codes_of((4.0, 10.0, UNSTABLE)), codes_of((4.09, 10.0, UNSTABLE))) == []


def test_the_usual_shift_of_edges_is_no_error():
    """A window of the past delays every edge by 0.12 s."""
    parts = [
        labelled(codes_of((at, 10, UNSTABLE)), codes_of((at + 0.12, 10, UNSTABLE)), name=f"at {at}")
        for at in (3.0, 4.0, 5.0, 6.0)
    ]
    assert suspects(parts) == []
    late = labelled(codes_of((7.0, 10, UNSTABLE)), codes_of((7.32, 10, UNSTABLE)), name="late")
    (found,) = suspects([*parts, late])
    assert (found.recording, found.kind, found.start) == ("late", "edge", 7.0)
    assert (found.shift, found.confidence) == (pytest.approx(0.2), pytest.approx(0.9))


def test_an_edge_that_is_far_off_is_an_interval():
    (found,) = suspects_in(codes_of((4.0, 10.0, UNSTABLE)), codes_of((4.8, 10.0, UNSTABLE)))
    assert (found.kind, found.start, found.end) == ("interval", 4.0, 4.8)


def test_low_probabilities_make_no_suspects():
    parts = [calm(f"calm {k}") for k in range(3)]
    doubtful = labelled(codes_of(), codes_of((3.0, 3.4, UNSTABLE)), sure=0.5)
    assert suspects([*parts, doubtful]) == []
    edge = codes_of((4.0, 10.0, UNSTABLE)), codes_of((4.3, 10.0, UNSTABLE))
    assert suspects([*parts, labelled(*edge, sure=0.5)]) == []
    assert len(suspects([*parts, labelled(*edge, sure=0.7)])) == 1


def test_stretches_without_label_or_probability_make_no_suspects():
    part = labelled(codes_of(), codes_of((3.0, 3.4, UNSTABLE), (5.0, 6.0, UNSTABLE)))
    part.probabilities[490:610] = np.nan
    labels = [Label(0.0, 2.9, STABLE), Label(3.5, 10.0, STABLE)]
    assert suspects([replace(part, labels=labels), calm("a"), calm("b")]) == []


def test_suspects_are_sorted_by_weight_and_thresholds_are_per_finger():
    spans = [(2.0, 2.2, UNSTABLE), (3.0, 3.5, UNSTABLE)]
    parts = [
        calm("a"),
        calm("b"),
        calm("a", "index"),
        calm("b", "index"),
        labelled(codes_of(), codes_of(*spans)),
        labelled(codes_of(), codes_of((4.0, 4.3, UNSTABLE)), finger="index"),
    ]
    found = suspects(parts)
    assert [(s.finger, s.start) for s in found] == [("thumb", 3.0), ("index", 4.0), ("thumb", 2.0)]
    assert found == suspects(parts[::-1])


def test_no_labels_have_no_suspects():
    assert suspects([]) == []


def mistaken(recordings, place, wrong):
    """The recordings, with [start, end) of a thumb labelled with another state."""
    start, end, state = wrong
    labels = []
    for label in recordings[place].modules["thumb"].labels:
        if label.start < start:
            labels.append(replace(label, end=min(label.end, start)))
        if label.end > end:
            labels.append(replace(label, start=max(label.start, end)))
    labels.append(Label(start, end, state))
    own = {"thumb": labels, "index": recordings[place].modules["index"].labels}
    return [r.with_labels(own) if k == place else r for k, r in enumerate(recordings)]


@pytest.fixture(scope="module")
def grasps():
    return [tiny_recording(seed) for seed in range(5)]


def test_an_audit_finds_a_wrong_label(grasps):
    found = audit(mistaken(grasps, 2, (5.0, 5.6, UNSTABLE)), n_folds=5)
    first = found.suspects[0]
    assert (first.recording, first.finger, first.kind) == ("grasp-2", "thumb", "interval")
    assert (first.given, first.expected) == ("unstable", "stable")
    assert first.start == pytest.approx(5.0, abs=0.15)
    assert first.end == pytest.approx(5.6, abs=0.15)
    assert found.n_recordings == 5
    assert 5 * 2 * 4.0 < found.judged < 5 * 2 * 6.0


def test_an_audit_of_a_sequence_that_reads_lazily(grasps):
    class Lazy(list):
        n_read = 0

        def __getitem__(self, index):
            self.n_read += not isinstance(index, slice)
            return super().__getitem__(index)

    lazy = Lazy(grasps)
    assert audit(lazy, n_folds=2) == audit(grasps, n_folds=2)


def test_the_json_document():
    document = json.loads(
        msgspec.json.encode(Audit(3, 12.5, suspects_in(codes_of(), codes_of((3, 4, NONE)))))
    )
    assert document["n_recordings"] == 3
    assert document["judged"] == 12.5
    assert document["suspects"] == [
        {
            "recording": "one",
            "finger": "thumb",
            "kind": "interval",
            "start": 3.0,
            "end": 4.0,
            "given": "stable",
            "expected": "no_contact",
            "confidence": pytest.approx(0.9),
            "shift": None,
        }
    ]


def test_the_default_features_depend_on_the_unit(grasps):
    assert default_setting(grasps).features == parse_features("holdfast")
    module = grasps[0].modules["thumb"]
    newton = Recording("n", {"thumb": Tactile(TINY, module.times, module.readings, unit="N")})
    assert default_setting([newton]).features == parse_features(DEPLOYED_FEATURES)
    assert default_setting([]).trials == 0


@pytest.mark.parametrize(
    ("recordings", "text"),
    [
        (
            [],
            "an audit compares the labels of a recording with those of others: at least 2 "
            "recordings expected, 0 given",
        ),
        (
            [tiny_recording(1, n=100), tiny_recording(2, n=100)],
            "none of the labels of 2 recordings can be audited: a finger needs two states, after "
            "tare and first window, in at least two recordings",
        ),
    ],
)
def test_recordings_that_cannot_be_audited(recordings, text):
    with pytest.raises(TrainingError) as error:
        audit(recordings)
    assert str(error.value) == text


def test_the_setting_may_be_chosen(grasps):
    own = audit(grasps, Setting(trials=0), n_folds=2)
    assert own.judged > audit(grasps, n_folds=2).judged  # a shorter first window
