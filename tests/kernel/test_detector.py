"""The detector of the extension: chunks, its estimates, and rules that do not fit."""

import copy
import pickle
import threading

import numpy as np
import pytest
from msgspec.structs import replace

from detector.build import cause_head, lively, model
from holdfast.contact import Cause
from holdfast.detector import Detector
from holdfast.detector.tables import ESTIMATE, rules_of
from holdfast.exporters.c_header import ctypes_of, kernel_text, structs_of
from holdfast.kernel import _extension

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


class TestEstimates:
    @pytest.fixture
    def estimate(self):
        detector = Detector(with_causes())
        for k, sample in enumerate(lively(60)):
            estimate = detector.update({"thumb": sample, "index": sample}, k / 100)
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
        assert len(_extension.Estimates()) == 0
        with pytest.raises(KeyError):
            _extension.Estimates()["thumb"]

    def test_they_have_the_layout_of_the_struct(self):
        assert _extension.Estimates.__itemsize__ == ESTIMATE.itemsize
        fields = {"estimate": structs_of(kernel_text())["holdfast_finger_estimate"]}
        struct = ctypes_of(fields, {"HOLDFAST_MASK_WORDS": 8}, single=False)["estimate"]
        offsets = {name: getattr(struct, name).offset for name, *_ in struct._fields_}
        short = {
            "faulty_taxels": "taxels", "stable_probability": "probability",
            "slip_probability": "slip", "slip_speed": "speed", "slip_distance": "distance",
            "instability": "sigma",
        }  # fmt: skip
        expected = {short.get(name, name): offset for name, offset in offsets.items()}
        assert {name: ESTIMATE.fields[name][1] for name in ESTIMATE.names} == expected


class TestDetector:
    @pytest.mark.parametrize("call", [copy.copy, copy.deepcopy, pickle.dumps])
    def test_it_cannot_be_copied(self, call):
        with pytest.raises(TypeError, match=r"cannot pickle .*Detector. object"):
            call(Detector(with_causes())._kernel)

    def test_another_thread_is_refused(self):
        detector, refused, n = Detector(with_causes())._kernel, [], 20_000
        arguments = [
            np.ones((n, 4, 3)), np.ones((n, 2), dtype=bool), np.arange(float(n)),
            np.zeros((n, 2, ESTIMATE.itemsize // 8)), np.zeros(n),
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
        ("change", "wrong"),
        [
            (lambda r, h, w: (r[:1], h, w), "lists of a rule and four heads"),
            (lambda r, h, w: (r, h, w[:-1]), "first of a head"),
            (lambda r, h, w: (r, h, w * np.nan), "a weight of a head"),
            (lambda r, h, w: (r, [h[0] | {"n_features": 99}, *h[1:]], w), "n_features or has_sq"),
            (lambda r, h, w: (r, [h[0] | {"n_outputs": 0}, *h[1:]], w), "n_outputs of a head"),
            (lambda r, h, w: (r, [h[0] | {"gain": np.nan}, *h[1:]], w), "a number of a head"),
            (lambda r, h, w: (r, [*h[:3], h[3] | {"causes": [9] * 6}, *h[4:]], w), "causes of"),
            (lambda r, h, w: ([r[0] | {"contact": 4}, r[1]], h, w), "contact or contact_limit"),
            (lambda r, h, w: ([r[0] | {"contact": 3}, r[1]], h, w), "contact by the load of a"),
        ],
    )
    def test_rules_that_do_not_fit_are_refused(self, change, wrong):
        used = with_causes()
        detector = Detector(used)
        with pytest.raises(ValueError, match=wrong):
            detector._kernel.set_rules(*change(*rules_of(used, detector._stream.plan)))

    def test_a_list_that_a_number_cuts_is_refused(self):
        used = with_causes()
        detector = Detector(used)._kernel
        rules, heads, weights = rules_of(used, Detector(used)._stream.plan)

        class Cutting:
            def __float__(self):
                heads.clear()
                return 1.0

        heads[0] = heads[0] | {"gain": Cutting()}
        with pytest.raises(IndexError):
            detector.set_rules(rules, heads, weights)

    def test_a_number_cannot_call_the_detector(self):
        used = with_causes()
        detector = Detector(used)._kernel
        rules, heads, weights = rules_of(used, Detector(used)._stream.plan)

        class Calling:
            def __float__(self):
                detector.update({}, 1.0)
                return 1.0

        heads[0] = heads[0] | {"gain": Calling()}
        with pytest.raises(RuntimeError, match="another thread"):
            detector.set_rules(rules, heads, weights)
        assert detector.update({}, 1.0) is not None
