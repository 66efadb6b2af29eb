import json
import math
import random
import tracemalloc

import numpy as np
import pytest

from holdfast.contact import Fault
from holdfast.devices.sources.xela.decoder import XelaDecoder
from holdfast.errors import SourceError
from holdfast.sensors import hand

from .build import PERIOD, START, counts, patch, sensor, text


def taught(first, **options):
    decoder = XelaDecoder(**options)
    assert decoder.identify(first)
    return decoder


def fed(decoder, packets, received=100.0):
    """What comes of packets that arrive every 10 ms."""
    return [a for k, p in enumerate(packets) for a in decoder.decode(p, received + k * PERIOD)]


def own(k, lag=0.0, **fields):
    """A sensor of version 1.8, whose own stamp lags behind its packet's."""
    return sensor(counts(16, k), time=START + k * PERIOD - lag, **fields)


class TestSamples:
    def test_one_arrival_a_packet(self):
        packets = [patch(k) for k in range(50)]
        arrivals = fed(taught(packets[0]), packets)
        assert [a.time for a in arrivals] == [START + k * PERIOD for k in range(50)]
        for k, arrival in enumerate(arrivals):
            np.testing.assert_array_equal(arrival.samples["finger1"], counts(16, k))
            assert arrival.received == 100.0 + k * PERIOD
            assert (arrival.faults, arrival.n_lost, arrival.n_refused) == ({}, 0, 0)
            assert arrival.notices == ()

    def test_real_packets(self, real_packets):
        for whole in real_packets.values():
            decoder = taught(whole)
            arrivals = decoder.decode(whole, 0.0)
            fields = json.loads(whole)
            n_values = sum(len(fields[str(n)]["integer"]) for n in decoder.devices)
            assert sum(s.size for a in arrivals for s in a.samples.values()) == n_values
            samples = {name: s for a in arrivals for name, s in a.samples.items()}
            assert samples.keys() == decoder.sensors.keys()
            for number, skin in decoder.devices.items():
                flat = np.array(fields[str(number)]["integer"]).reshape(-1, 3)
                for name, expected in skin.split(flat).items():
                    np.testing.assert_array_equal(samples[name], expected)


class TestLearning:
    @pytest.mark.parametrize("calibrated", [None, []])
    def test_without_newtons(self, calibrated):
        packet = text(1, {3: sensor(counts(16), calibrated=calibrated)})
        with pytest.raises(SourceError, match=r"sensor 3 .*values=counts"):
            XelaDecoder(calibrated=True).identify(packet)


class TestRepeats:
    def test_a_repeated_packet_is_no_sample(self):
        packets = [patch(k // 3) for k in range(30)]
        arrivals = fed(taught(packets[0]), packets)
        assert [a.time for a in arrivals] == [START + k * PERIOD for k in range(10)]

    def test_the_same_readings_with_a_new_stamp_are_a_sample(self):
        packets = [text(k, [sensor(counts(16))]) for k in range(5)]
        assert len(fed(taught(packets[0]), packets)) == 5

    def test_a_new_counter_with_the_same_stamp_is_a_sample(self):
        packets = [patch(k, time=START) for k in range(3)]
        times = [a.time for a in fed(taught(packets[0]), packets)]
        assert times[0] == START
        assert times[0] < times[1] < times[2] < START + 1e-5

    def test_a_sensor_whose_own_stamp_stays_has_no_new_sample(self):
        """The second sensor is read half as often."""
        packets = [text(k, [own(k), own(k // 2 * 2)]) for k in range(20)]
        arrivals = fed(taught(packets[0]), packets)
        seen = {name: [a for a in arrivals if name in a.samples] for name in ("finger1", "finger2")}
        assert len(seen["finger1"]) == 20
        assert [a.time for a in seen["finger2"]] == [START + k * PERIOD for k in range(0, 20, 2)]
        assert len(arrivals) == 20


class TestCounter:
    def test_missing_packets_are_counted(self):
        packets = [patch(k) for k in (0, 1, 4, 5, 6, 16)]
        assert [a.n_lost for a in fed(taught(packets[0]), packets)] == [0, 0, 2, 0, 0, 9]


class TestTimes:
    def test_sensors_with_stamps_of_their_own_arrive_at_instants_of_their_own(self):
        packets = [text(k, [own(k), own(k, lag=0.004)]) for k in range(10)]
        arrivals = fed(taught(packets[0]), packets)
        assert [list(a.samples) for a in arrivals] == [["finger2"], ["finger1"]] * 10
        expected = [START + k * PERIOD - lag for k in range(10) for lag in (0.004, 0.0)]
        assert [a.time for a in arrivals] == expected
        assert {a.received for a in arrivals[:2]} == {100.0}
        assert not any(a.faults for a in arrivals)


class TestRefusals:
    def test_an_invalid_sensor_does_not_affect_the_others(self):
        good = [sensor(counts(16, k)) for k in (1, 2)]
        decoder = taught(text(1, good))
        (arrival,) = decoder.decode(text(2, [good[0], sensor(counts(16), data="ZZ")]), 0.0)
        assert list(arrival.samples) == ["finger1"]
        assert arrival.n_refused == 1
        assert "sensor 2" in arrival.notices[0]

    def test_a_packet_with_two_bad_sensors_is_refused_once(self):
        decoder = taught(text(0, [sensor(counts(16)), sensor(counts(16))]))
        (arrival,) = decoder.decode(text(1, [{"data": "?"}, {"data": "?"}]), 0.0)
        assert arrival.n_refused == 1
        assert len(arrival.notices) == 2

    def test_another_number_of_taxels_of_a_whole_hand(self):
        decoder = taught(text(0, [sensor(counts(368), "XR23AHRCPP")]))
        (arrival,) = decoder.decode(text(1, [sensor(counts(240), "XR23AHRCPP", taxels=240)]), 0.0)
        assert arrival.faults == dict.fromkeys(hand("allegro-uskin").modules, (Fault.TAXEL_COUNT,))

    def test_a_fault_is_reported_also_after_another_notice(self):
        """Notices about one sensor once delayed the fault of a wrong number of taxels."""
        decoder = taught(patch(0))
        decoder.decode(text(1, [sensor(counts(16), data="?")]), 0.0)
        wrong = [text(k, [sensor(counts(15), taxels=15)]) for k in (2, 3)]
        arrivals = [arrival for packet in wrong for arrival in decoder.decode(packet, 0.1)]
        assert [a.faults for a in arrivals] == [{"finger1": (Fault.TAXEL_COUNT,)}] * 2
        assert [len(a.notices) for a in arrivals] == [1, 0]

    def test_a_sensor_that_ends_is_missing(self):
        decoder = taught(text(0, [sensor(counts(16)), sensor(counts(16))]))
        (arrival,) = decoder.decode(patch(1), 0.0)
        assert list(arrival.samples) == ["finger1"]


TOKENS = [
    b"null", b"true", b"-1", b"1e308", b"NaN", b"[]", b"{}", b'""', b'"1"', b"[[[[", b"0.5",
    b'"FFFF"', b"99999999999999999999999999", b'"\\ud800"', b"\xff\xfe",
]  # fmt: skip


def mutated(packet, dice):
    """A packet that was damaged in one to four places."""
    given = bytearray(packet)
    for _ in range(dice.randint(1, 4)):
        a, b = sorted(dice.randrange(len(given) + 1) for _ in range(2))
        match dice.randrange(6):
            case 0 if given:
                given[a % len(given)] ^= 1 << dice.randrange(8)
            case 1:
                del given[a : min(b, a + 20)]
            case 2:
                del given[a:]
            case 3:
                given[a:a] = given[a : min(b, a + 50)]
            case 4:
                given[a : a + dice.randrange(12)] = dice.choice(TOKENS)
            case _:
                start = given.find(b":", a) + 1
                end = min(given.find(mark, start) % (len(given) + 1) for mark in (b",", b"}"))
                given[start:end] = dice.choice(TOKENS)
    return bytes(given)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_damaged_packets_do_no_harm(seed):
    """10,000 of them, among good ones."""
    dice = random.Random(seed)
    good = [text(k, [own(k), sensor(counts(16, k + 1))]).encode() for k in range(40)]
    decoder = taught(good[0])
    last, n_refused, n_taken, kept = -math.inf, 0, 0, 0
    tracemalloc.start()
    try:
        for k in range(2500):
            for arrival in decoder.decode(mutated(dice.choice(good), dice), k * PERIOD):
                n_refused += arrival.n_refused
                n_taken += bool(arrival.samples)
                if arrival.samples:
                    assert arrival.time > last
                    last = arrival.time
            if k == 500:
                kept = tracemalloc.get_traced_memory()[0]
        assert tracemalloc.get_traced_memory()[0] - kept < 100_000
    finally:
        tracemalloc.stop()
    assert n_refused > 500
    assert n_taken > 100
    for k in (5000, 5001):
        fresh = text(k, [own(k), sensor(counts(16, k + 1))])
        arrivals = decoder.decode(fresh, k * PERIOD)
        samples = {name: s for a in arrivals for name, s in a.samples.items()}
        np.testing.assert_array_equal(samples["finger1"], counts(16, k))
        np.testing.assert_array_equal(samples["finger2"], counts(16, k + 1))
        assert arrivals[0].time > last
