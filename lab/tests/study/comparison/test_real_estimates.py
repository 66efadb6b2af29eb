from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Cause, ContactState
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.comparison.real_estimates import (
    load_fingers,
    method_estimates,
    recording_labels,
)
from holdfast_lab.study.evaluation.evaluate_method import EvaluationJob, score_splits
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import save_all

FINGERS = ("finger1", "finger2")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    """Three recordings of four seconds around the shaking."""
    recordings = []
    for seed in range(3):
        made = synthetic_recording(f"r{seed}", seed, FINGERS)
        modules = {name: module.slice(450, 1050) for name, module in made.modules.items()}
        recordings.append(replace(made, modules=modules))
    folder = save_all(tmp_path_factory.mktemp("real") / "real", recordings)
    return scan_corpus("real", folder, tare="first")


def test_labels_of_fingers_and_hand(tmp_path):
    recording = synthetic_recording("a", 0, FINGERS)
    own = {
        "finger1": [
            Label(1.0, 3.0, ContactState.STABLE),
            Label(3.0, 4.0, ContactState.UNSTABLE, Cause.SLIP),
            Label(4.0, 5.0, ContactState.UNSTABLE, Cause.CLOSING),
            Label(5.0, 6.0, ContactState.UNSTABLE),
        ],
        "finger2": [Label(1.0, 6.0, ContactState.STABLE)],
    }
    other = synthetic_recording("b", 1, FINGERS)
    save_all(tmp_path / "real", [recording.with_labels(own), other])
    label = recording_labels(scan_corpus("real", tmp_path / "real"))[0]
    times = label.hand.times.array
    at = [int(np.searchsorted(times, t)) for t in (0.5, 2.0, 3.5, 4.5, 5.5, 7.0)]
    assert label.fingers["finger1"].slip.array[at].tolist() == [0, 0, 1, 0, 1, 0]
    assert not label.fingers["finger2"].slip.array.any()
    assert label.hand.codes.array[at].tolist() == [
        UNKNOWN, STABLE, UNSTABLE, UNSTABLE, UNSTABLE, UNKNOWN,
    ]  # fmt: skip
    assert label.hand.slip.array[at].tolist() == [0, 0, 1, 0, 1, 0]


@pytest.mark.slow
def test_each_recording_has_the_estimates_of_a_fit_to_the_others(corpus):
    """They are the decisions of the study's evaluation with a fold for each recording."""
    found = method_estimates("logreg", corpus, seed=0)
    assert [each.name for each in found] == ["r0", "r1", "r2"]
    ((_, scored),) = score_splits(EvaluationJob("logreg", corpus))
    for each, expected in zip(found, scored, strict=True):
        decided = expected.decide(expected.recording.labels)
        for name, finger in decided.fingers.items():
            np.testing.assert_array_equal(each.fingers[name].states.array, finger.states)
            np.testing.assert_array_equal(
                each.fingers[name].probability.array, finger.stable_probability
            )
        np.testing.assert_array_equal(each.hand.states.array, decided.hand.states)
        assert (each.known.array == (decided.hand.states != UNKNOWN)).all()


def test_only_fingers_of_both_classes_are_loaded(tmp_path):
    calm = synthetic_recording("a", 0, FINGERS)
    stable = [Label(3.0, 4.0, ContactState.STABLE)]
    one = calm.with_labels({"finger1": calm.modules["finger1"].labels, "finger2": stable})
    save_all(tmp_path / "real", [one, synthetic_recording("b", 1, FINGERS[:1])])
    corpus = scan_corpus("real", tmp_path / "real")
    assert [list(each.modules) for each in load_fingers(corpus)] == [["finger1"]] * 2
