"""The detector of the extension: chunks, its estimates, and rules that do not fit."""

import copy
import gc
import pickle
import threading
import weakref

import numpy as np
import pytest
from msgspec.structs import replace

from detection.detector.build import RATE, cause_head, lively, model
from holdfast.contact import Cause
from holdfast.detection import Detector
from holdfast.detection.kernel_config import packed, stream_config
from holdfast.detection.traces import EstimateTypes
from holdfast.kernel.structs import struct_type
from kernel.extension import extension

N = 3000
EVERY_CAUSE = tuple(Cause)


def with_causes(**options):
    """A model with every kind of head for two fingers, and the forward filter."""
    made_model = model(slips=("thumb",), speeds=("thumb",), threshold=60.0, **options)
    fingers = {
        name: part.with_heads(cause_head(part.features, seed, EVERY_CAUSE[seed:]))
        for seed, (name, part) in enumerate(made_model.fingers.items())
    }
    debounce = replace(made_model.debounce, switching=15.0, hysteresis=0.1, hold=0.05)
    return replace(made_model, fingers=fingers, debounce=debounce)


def plan_of(used):
    return used.plan(dict.fromkeys(used.fingers, used.sensors["tiny"]), RATE)


def made_kernel(note=print):
    """A detector of the extension that calls `note` at each change of state."""
    plan = plan_of(with_causes())
    config = *packed(stream_config(plan)), plan.baseline.tobytes()
    types = EstimateTypes({name: index for index, name in enumerate(plan.fingers)}, note)
    return extension.Detector(*config, *packed(with_causes().config(plan)), types)


class TestEstimates:
    @pytest.fixture
    def estimate(self):
        detector = Detector(with_causes())
        for k, sample in enumerate(lively(60)):
            estimate = detector.update({"thumb": sample, "index": sample + 1.0}, k / 100)
        return estimate

    def test_they_are_a_mapping(self, estimate):
        fingers = estimate.fingers
        assert (list(fingers), len(fingers), "thumb" in fingers) == (["thumb", "index"], 2, True)
        assert fingers == dict(fingers)
        assert fingers["thumb"] == fingers["thumb"]
        assert fingers["index"].slip_probability is None
        assert fingers["thumb"].slip_speed is not None
        with pytest.raises(KeyError, match="ring"):
            fingers["ring"]

    @pytest.mark.parametrize(
        "call", [copy.copy, copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))]
    )
    def test_they_are_copied_as_a_dictionary(self, estimate, call):
        assert call(estimate) == estimate
        assert type(call(estimate.fingers)) is dict

    def test_they_outlive_the_detector(self):
        kept = [Detector(with_causes()).update({}, float(k)) for k in range(100)]
        assert {str(estimate.fingers["thumb"].state) for estimate in kept} == {"UNKNOWN"}

    def test_one_that_no_detector_made_has_no_fingers(self):
        assert len(extension.Estimates()) == 0
        with pytest.raises(KeyError):
            extension.Estimates()["thumb"]

    def test_they_have_the_layout_of_the_struct(self):
        kind = struct_type("holdfast_finger_estimate")
        assert extension.Estimates.__itemsize__ == kind.itemsize


class TestDetector:
    @pytest.mark.parametrize("call", [copy.copy, copy.deepcopy, pickle.dumps])
    def test_it_cannot_be_copied(self, call):
        with pytest.raises(TypeError, match=r"cannot pickle .*Detector. object"):
            call(made_kernel())

    def test_another_thread_is_refused(self):
        detector, refused, n = made_kernel(), [], 20_000
        arguments = [
            np.ones((n, 4, 3)), np.ones((n, 2), dtype=bool), np.arange(float(n)),
            np.zeros((n, 2 * extension.Estimates.__itemsize__ // 8)), np.zeros(n),
        ]  # fmt: skip
        for _ in range(50):  # until a call was made while the thread was inside one
            thread = threading.Thread(target=detector.run, args=arguments)
            thread.start()
            while thread.is_alive():
                try:
                    detector.update({}, -1.0)
                except RuntimeError as error:
                    refused.append(str(error))
            thread.join()
            arguments[2] = arguments[2] + n
            if refused:
                break
        assert set(refused) == {"another thread is using this detector"}

    @pytest.mark.parametrize(
        ("finger", "head", "field", "value", "wrong"),
        [
            (0, 0, "first", 99, "first of a head"),
            (0, 0, "n_features", 99, "n_features or has_squares of a head"),
            (0, 0, "n_outputs", 0, "n_outputs of a head"),
            (1, 0, "gain", np.nan, "a number of a head"),
            (1, 3, "causes", 9, "causes of a head"),
            (0, None, "contact", 4, "contact or contact_limit of a finger"),
            (1, None, "contact", 3, "contact by the load of a hand without lags"),
        ],
    )
    def test_rules_that_do_not_fit_are_refused(self, finger, head, field, value, wrong):
        used, kernel = with_causes(), made_kernel()
        _, rules, weights = used.config(plan_of(used))
        (rules[finger] if head is None else rules[finger]["heads"][head])[field] = value
        with pytest.raises(ValueError, match=wrong):
            kernel.set_rules(rules.tobytes(), weights.tobytes())
        assert kernel.update({}, 1.0) is not None

    @pytest.mark.parametrize("n_rules", [1, 3])
    def test_rules_of_other_fingers_are_refused(self, n_rules):
        used, kernel = with_causes(), made_kernel()
        _, rules, weights = used.config(plan_of(used))
        other = np.concatenate([rules, rules])[:n_rules]
        with pytest.raises(ValueError, match="rules: "):
            kernel.set_rules(other.tobytes(), weights.tobytes())
        with pytest.raises(ValueError, match="weights: "):
            kernel.set_rules(rules.tobytes(), weights[:-1].tobytes())
        with pytest.raises(ValueError, match="a weight of a head"):
            kernel.set_rules(rules.tobytes(), (weights * np.nan).tobytes())

    def test_a_change_cannot_call_the_detector(self):
        refused = []

        def note(change):
            try:
                kernel.update({}, 99.0)
            except RuntimeError as error:
                refused.append(str(error))

        kernel = made_kernel(note)
        for k, sample in enumerate(lively(60)):
            kernel.update({"thumb": sample, "index": sample + 1.0}, k / 100)
        assert set(refused) == {"another thread is using this detector"}

    def test_a_cycle_through_what_it_calls_is_collected(self):
        class Note:
            def __call__(self, change):
                pass

        note = Note()
        note.kernel = made_kernel(note)
        dead = weakref.ref(note)
        del note
        gc.collect()
        assert dead() is None
