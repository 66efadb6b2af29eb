import json
from dataclasses import replace

import numpy as np
import pytest

from holdfast.devices.sources.xela.decoder import XelaDecoder
from holdfast.devices.sources.xela.encoder import (
    MAX_MODULE_WAIT,
    NEWTONS_PER_TAXEL_COUNT,
    REST_READING,
    SampleBatcher,
    XelaEncoder,
)
from holdfast.sensors import hand, sensor
from holdfast.sensors.xela_models import flat_grid

from .build import START, counts

TIPS = dict.fromkeys(("thumb", "index", "middle", "ring"), sensor("uskin-curved"))
WHOLE = {name: module.sensor for name, module in hand("allegro-uskin").modules.items()}


def newtons(name="uskin-4x4"):
    return replace(sensor(name), unit="N", range=None)


def samples_of(sensors, k=0):
    return {
        name: counts(one.n_taxels, 100 * k + index)
        for index, (name, one) in enumerate(sensors.items())
    }


def parsed(encoder, samples, time=START, sent=START + 1):
    return json.loads(encoder.packet(samples, time, sent))


def decoded(encoder, packets, **options):
    """What a client that names the sensors as they are makes of packets."""
    names = {n: names[0] for n, names in encoder.modules.items() if len(names) == 1}
    decoder = XelaDecoder(names, **options)
    assert decoder.identify(packets[0])
    return [a for k, p in enumerate(packets) for a in decoder.decode(p, 0.01 * k)]


@pytest.mark.parametrize("version", ["1.7", "1.8"])
@pytest.mark.parametrize("sensors", [TIPS, WHOLE], ids=["tips", "hand"])
def test_what_is_decoded_is_what_was_encoded(version, sensors):
    encoder = XelaEncoder(sensors, version=version)
    given = [samples_of(sensors, k) for k in range(20)]
    times = [START + k / 150 for k in range(20)]
    packets = [encoder.packet(s, t, t) for s, t in zip(given, times, strict=True)]
    arrivals = decoded(encoder, packets)
    assert [a.time for a in arrivals] == times
    for arrival, expected in zip(arrivals, given, strict=True):
        assert list(arrival.samples) == list(expected)
        for name, readings in expected.items():
            np.testing.assert_array_equal(arrival.samples[name], readings)
            assert arrival.samples[name].dtype == np.uint16
        assert (arrival.faults, arrival.n_lost, arrival.notices) == ({}, 0, ())


@pytest.mark.parametrize(
    ("model", "sensors"),
    [("XR23AHRCPP", WHOLE), ("uSPa35", {"finger1": flat_grid("uSPa35", 15)})],
)
def test_fields_of_1_8_are_those_of_a_real_server(model, sensors, real_packets):
    real = json.loads(real_packets[model])
    packet = parsed(XelaEncoder(sensors, version="1.8"), samples_of(sensors))
    assert list(packet) == [key for key in real if key != "2"]
    assert list(packet["1"]) == list(real["1"])
    for field, value in real["1"].items():
        assert type(packet["1"][field]) is type(value)
        if isinstance(value, list | str) and field not in ("model", "handedness"):
            assert len(packet["1"][field]) == len(value)
    assert packet["1"]["model"].lower() == real["1"]["model"].lower()


def test_the_first_message_is_welcome():
    assert json.loads(XelaEncoder(TIPS, version="1.7").welcome()) == {"message": "Welcome"}
    assert json.loads(XelaEncoder(TIPS).welcome())["message"] == "Welcome"


def test_the_counter_counts():
    encoder = XelaEncoder({"a": sensor("uskin-4x4")})
    numbers = [parsed(encoder, {"a": np.zeros((16, 3))})["message"] for _ in range(3)]
    assert numbers == [0, 1, 2]


def test_a_sensor_without_a_sample_is_left_out():
    encoder = XelaEncoder(TIPS)
    packet = parsed(encoder, {"index": counts(30), "ring": counts(30, 1)})
    assert [key for key in packet if key.isdigit()] == ["2", "4"]
    assert packet["sensors"] == 2
    assert encoder.modules == {1: ("thumb",), 2: ("index",), 3: ("middle",), 4: ("ring",)}
    assert not encoder.is_hand


class TestWholeHand:
    def test_fingertips_inside_a_hand(self):
        encoder = XelaEncoder(TIPS, whole_hand=True)
        assert encoder.is_hand
        given = [samples_of(TIPS, k) for k in range(5)]
        packets = [encoder.packet(s, START + k, 0.0) for k, s in enumerate(given)]
        for arrival, expected in zip(decoded(encoder, packets), given, strict=True):
            assert list(arrival.samples) == list(WHOLE)
            for name, readings in expected.items():
                np.testing.assert_array_equal(arrival.samples[name], readings)
            for name in set(WHOLE) - set(TIPS):
                assert (np.abs(arrival.samples[name].astype(float) - REST_READING) < 300).all()

    def test_a_module_without_a_sample_repeats_its_last(self):
        encoder = XelaEncoder(WHOLE)
        first = samples_of(WHOLE)
        thumb = {"thumb": counts(30, 77)}
        packets = [encoder.packet(first, START, 0.0), encoder.packet(thumb, START + 1, 0.0)]
        _, arrival = decoded(encoder, packets)
        for name, readings in (first | thumb).items():
            np.testing.assert_array_equal(arrival.samples[name], readings)

    def test_a_hand_with_another_sensor_is_sent_in_parts(self):
        assert not XelaEncoder(WHOLE | {"thumb": sensor("uskin-4x4")}).is_hand


class TestReadings:
    @pytest.mark.parametrize(("wrong", "told_as"), [(-1, "-1 to 0"), (65536.0, "0 to 65536")])
    def test_what_is_no_count_is_refused(self, wrong, told_as):
        readings = np.zeros((16, 3), dtype=type(wrong))
        readings[3, 1] = wrong
        with pytest.raises(ValueError, match=told_as):
            XelaEncoder({"a": sensor("uskin-4x4")}).packet({"a": readings}, 0.0, 0.0)

    def test_a_module_with_nan_is_left_out(self):
        two = dict.fromkeys("ab", sensor("uskin-4x4"))
        broken = np.zeros((16, 3))
        broken[0, 0] = np.nan
        packet = parsed(XelaEncoder(two), {"a": broken, "b": np.zeros((16, 3))})
        assert "1" not in packet
        assert packet["2"]["integer"] == [0] * 48

    def test_newtons(self):
        encoder = XelaEncoder({"a": newtons()})
        force = np.random.default_rng(0).normal(size=(16, 3))
        force[2, 1] = np.nan
        packet = encoder.packet({"a": force}, START, 0.0)
        (arrival,) = decoded(encoder, [packet], calibrated=True)
        np.testing.assert_array_equal(arrival.samples["a"], force)
        (counted,) = decoded(encoder, [packet])
        known = np.isfinite(force)
        errors = counted.samples["a"] - (REST_READING + force / NEWTONS_PER_TAXEL_COUNT)
        assert np.abs(errors[known]).max() <= 0.5
        assert counted.samples["a"][2, 1] == REST_READING[1]


def batches(batcher, given):
    """Time of each batch, and the samples of its modules with their times."""
    due = [one for time, samples in given for one in batcher.add(samples, time)]
    due += batcher.flush()
    return [(one.time, {n: (s, one.times[n]) for n, s in one.samples.items()}) for one in due]


LATE = MAX_MODULE_WAIT + 0.1
TOGETHER = [(t, {"a": 10 + t, "b": 20 + t}) for t in range(3)]
TOGETHER_BATCHES = [(t, {"a": (10 + t, t), "b": (20 + t, t)}) for t in range(3)]
ALONE = [(t, {"a": t}) for t in (0.0, 0.9 * MAX_MODULE_WAIT, MAX_MODULE_WAIT, LATE)]
ALONE_BATCHES = [(t, {"a": (t, t)}) for t in (MAX_MODULE_WAIT, LATE)]


@pytest.mark.parametrize("own_stamps", [False, True])
@pytest.mark.parametrize(
    ("given", "expected"), [(TOGETHER, TOGETHER_BATCHES), (ALONE, ALONE_BATCHES)]
)
def test_samples_of_an_instant_and_of_one_module_are_batches(own_stamps, given, expected):
    """A module that never arrives is waited for once."""
    assert batches(SampleBatcher("ab", own_stamps=own_stamps), given) == expected


def test_with_own_stamps_every_sample_is_passed_on_at_once():
    given = [(0.0, {"a": 1}), (0.1, {"b": 2}), (0.2, {"a": 3}), (0.3, {"a": 4})]
    assert batches(SampleBatcher("ab", own_stamps=True), given) == [
        (0.1, {"a": (1, 0.0), "b": (2, 0.1)}),
        (0.2, {"a": (3, 0.2), "b": (2, 0.1)}),
        (0.3, {"a": (4, 0.3), "b": (2, 0.1)}),
    ]


def test_without_own_stamps_samples_wait_for_each_other():
    given = [(0.0, {"a": 1}), (0.1, {"b": 2}), (0.2, {"b": 3}), (0.3, {"a": 4}), (0.4, {"a": 5})]
    assert batches(SampleBatcher("ab", own_stamps=False), given) == [
        (0.1, {"a": (1, 0.0), "b": (2, 0.1)}),
        (0.3, {"a": (4, 0.3), "b": (3, 0.2)}),
        (0.4, {"a": (5, 0.4), "b": (3, 0.2)}),
    ]


def test_a_module_with_its_next_sample_does_not_wait():
    given = [(0.0, {"a": 1, "b": 2}), (0.1, {"a": 3}), (0.2, {"a": 4})]
    assert batches(SampleBatcher("ab", own_stamps=False), given) == [
        (0.0, {"a": (1, 0.0), "b": (2, 0.0)}),
        (0.1, {"a": (3, 0.1), "b": (2, 0.0)}),
        (0.2, {"a": (4, 0.2), "b": (2, 0.0)}),
    ]
