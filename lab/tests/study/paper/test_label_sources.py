import numpy as np

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.paper.label_sources import has_truth, relabelled
from study.example_recordings import recording_with_truth

RECORDING = recording_with_truth("grasp", 3)


def states(recording, finger="thumb"):
    return recording.modules[finger].label_states


def test_only_sliding_is_unstable_while_the_object_is_held():
    """The disturbance lasts from 5.3 to 6.5 s; the thumb slides from 5.6 to 5.9 and 6.0 to 6.2."""
    made = relabelled(RECORDING, "sliding", "0.5")
    times = made.modules["thumb"].times
    held = (times >= 3.0) & (times < 9.4)
    slides = ((times >= 5.6) & (times < 5.9)) | ((times >= 6.0) & (times < 6.2))
    assert (states(made)[held] == np.where(slides, UNSTABLE, STABLE)[held]).all()
    assert (states(made, "index")[held] == STABLE).all()


def test_outside_the_hold_only_sliding_changes_nothing():
    exact, made = (relabelled(RECORDING, source, "0.5") for source in ("exact", "sliding"))
    times = made.modules["thumb"].times
    outside = (times < 2.3) | (times > 9.6)
    assert (states(made)[outside] == states(exact)[outside]).all()
    assert (states(made)[times < 1.0] == NO_CONTACT).all()


def test_exact_labels_have_no_margin():
    made = relabelled(RECORDING, "exact", "0.5")
    times = made.modules["index"].times
    unstable = times[(states(made, "index") == UNSTABLE) & (times > 4) & (times < 7)]
    assert abs(unstable[0] - 5.3) < 0.01 and abs(unstable[-1] - 6.5) < 0.01


def test_drawn_labels_come_from_the_force_alone():
    made = relabelled(RECORDING, "drawn", "0.5")
    without_truth = relabelled(synthetic_recording("grasp", 3, ("thumb", "index")), "drawn", "0.5")
    assert (states(made) == states(without_truth)).all()
    assert {label.author for label in made.modules["thumb"].labels} == {"rule:signal"}


def test_without_a_truth_labels_stay():
    recording = synthetic_recording("grasp", 3)
    assert not has_truth(recording) and has_truth(RECORDING)
    for source in ("recording", "exact", "sliding"):
        assert relabelled(recording, source, "0.5") is recording
