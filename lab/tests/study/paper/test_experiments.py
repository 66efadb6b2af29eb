from dataclasses import replace

import pytest

from holdfast.contact import ContactState
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.paper import experiments
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import recordings_of_cases, save_all

pytestmark = pytest.mark.slow


def test_recordings_are_chosen_by_case_and_name_in_test_data_first(tmp_path):
    main = scan_corpus("main", save_all(tmp_path / "a", recordings_of_cases(["2", "failed", "1"])))
    others = scan_corpus("others", save_all(tmp_path / "b", recordings_of_cases(["2", "2"], 5)))
    shown = experiments.predict_examples({"others": others, "main": main}, "index", 0)
    assert [(s.experiment, s.role, s.recording) for s in shown] == [
        ("protocol", "main", "2-0"),
        ("failed", "main", "failed-1"),
        ("disturbed", "others", "2-5"),
    ]
    n = len(synthetic_recording("a", 0).modules["index"].times)
    assert not shown[0].states
    assert all(len(states) == n for s in shown[1:] for states in s.states.values())
    assert all(set(s.states) == {"logreg", "svm"} for s in shown[1:])


def test_a_recording_is_predicted_by_fits_without_it(tmp_path):
    """What a recording is labelled makes no difference to what is predicted of it."""
    found = []
    for state in (ContactState.STABLE, ContactState.UNSTABLE):
        first, *rest = recordings_of_cases(["2", "1", "1"])
        labels = {
            name: [replace(label, state=state) for label in module.labels]
            for name, module in first.modules.items()
        }
        folder = tmp_path / state.value
        main = scan_corpus("main", save_all(folder, [first.with_labels(labels), *rest]))
        found.append(experiments.predict_examples({"main": main}, "index", 0)[1])
    assert found[0].recording == "2-0"
    assert found[0] == found[1]
