"""A threshold that is changed while the detector runs acts as that of another model."""

import pytest
from msgspec.structs import replace

from holdfast.detector import Detector
from holdfast.live.adjustable_detector import AdjustableDetector
from live import build


def with_threshold(model, threshold):
    fingers = {
        name: replace(one, classifier=replace(one.classifier, threshold=threshold))
        for name, one in model.fingers.items()
    }
    return replace(model, fingers=fingers)


def test_it_decides_as_a_model_with_that_threshold():
    recording, model = build.grasp(), build.model()
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    changed = AdjustableDetector(model, sensors)
    changed.set_thresholds(dict.fromkeys(sensors, 0.95))
    expected = Detector(with_threshold(model, 0.95), sensors)
    own = Detector(model, sensors)
    states = {"changed": [], "own": []}
    for arrival in build.arrivals_of(recording):
        found = changed.update(arrival.samples, arrival.time)
        assert found.state == expected.update(arrival.samples, arrival.time).state
        states["changed"].append(found.state)
        states["own"].append(own.update(arrival.samples, arrival.time).state)
    assert states["changed"] != states["own"]
    changed.reset()  # keeps the thresholds
    expected.reset()
    for arrival in build.arrivals_of(recording)[:900]:
        found = changed.update(arrival.samples, arrival.time)
        assert found.state == expected.update(arrival.samples, arrival.time).state


@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan")])
def test_thresholds_outside_of_0_to_1_are_refused(value):
    recording = build.grasp()
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    detector = AdjustableDetector(build.model(), sensors)
    with pytest.raises(ValueError, match=r"^a threshold from 0 to 1 expected, "):
        detector.set_thresholds(dict.fromkeys(sensors, value))
