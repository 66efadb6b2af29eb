import math

import numpy as np
import pytest

from holdfast.contact import Fault
from holdfast.devices.sources.assembler import Assembler, Device, n_missing
from holdfast.sensors import hand, sensor

START, PERIOD = 1000.0, 0.01


def device(number, name="uskin-4x4", **given):
    return Device(number, name, {f"finger{number}": sensor(name)}, **given)


def assembler(*numbers, **options):
    made = Assembler(**options)
    made.devices = {number: device(number) for number in numbers}
    return made


def readings(k=0):
    return np.full((16, 3), k, np.uint16)


def packet(made, k, *numbers, stamp=None, received=None, own=None):
    """Arrivals of packet `k` with a sample of each of the devices."""
    at = 50.0 + k * PERIOD if received is None else received
    made.stamp(START + k * PERIOD if stamp is None else stamp, at)
    for number in numbers:
        made.add(number, readings(k), own)
    return made.finish(at)


class TestDevices:
    def test_modules_in_the_order_of_the_packet(self):
        modules = dict.fromkeys(("a", "b"), sensor("anyskin"))
        board = Device(1, "anyskin", modules)
        given = np.arange(30.0).reshape(10, 3)
        parts = board.split(given)
        assert (board.n_taxels, list(parts)) == (10, ["a", "b"])
        np.testing.assert_array_equal(parts["a"], given[:5])
        np.testing.assert_array_equal(parts["b"], given[5:])

    def test_models_and_the_hand(self):
        made = assembler(1)
        assert made.metadata == {"models": {"1": "uskin-4x4"}}
        whole = {name: one.sensor for name, one in hand("allegro-uskin").modules.items()}
        made.devices = {2: Device(2, "XR23AHRCPP", whole)}
        assert made.metadata == {"models": {"2": "XR23AHRCPP"}, "hand": "allegro-uskin"}
        assert made.sensors == whole

    def test_a_device_that_does_not_exist(self):
        made = assembler(1)
        assert made.accepts_device(1, 0.0)
        assert not made.accepts_device(2, 0.0)
        assert not made.accepts_device(3, 0.0)
        (arrival,) = made.finish(0.0)
        assert arrival.notices == tuple(
            f"sensor {k} was not there when the source was opened: open the source again"
            for k in (2, 3)
        )

    def test_another_number_of_taxels(self):
        made = assembler(1)
        assert made.accepts_taxels(1, 16, 0.0)
        assert made.finish(0.0) == []
        notices = []
        for k in range(3):  # a fault in every packet, but one notice
            assert not made.accepts_taxels(1, 15, 0.1 * k)
            (arrival,) = made.finish(0.1 * k)
            assert arrival.faults == {"finger1": (Fault.TAXEL_COUNT,)}
            notices += arrival.notices
        assert notices == ["sensor 1 sends 15 taxels, 16 expected"]


class TestTimes:
    def test_devices_with_equal_stamps_share_an_arrival(self):
        (arrival,) = packet(assembler(1, 2), 0, 1, 2)
        assert (arrival.time, list(arrival.samples)) == (START, ["finger1", "finger2"])

    def test_a_stamp_equal_to_that_of_the_packet_shares_its_arrival(self):
        made = assembler(1, 2)
        packet(made, 3, 1, 2)
        made.stamp(START + 2 * PERIOD, 50.0)  # a small step back, moved after the last time
        made.add(1, readings())
        made.add(2, readings(), START + 2 * PERIOD)
        (arrival,) = made.finish(50.0)
        assert arrival.time == math.nextafter(START + 3 * PERIOD, math.inf)
        assert list(arrival.samples) == ["finger1", "finger2"]

    def test_a_stamp_from_before_a_jump_is_replaced(self):
        made = assembler(1)
        (arrival,) = packet(made, 0, 1, own=START + 0.2)
        assert arrival.time == START
        (arrival,) = packet(made, 1, 1, own=START + PERIOD + 0.04)
        assert arrival.time == START + PERIOD + 0.04

    def test_a_jump_leaves_no_device_late(self):
        """Device 2 arrives 0.3 s late before the clock jumps; device 1 reveals the jump."""
        made = assembler(1, 2)
        for k in range(5):
            packet(made, k, 1, own=START + k * PERIOD)
            packet(made, k, 2, own=START + k * PERIOD)
        stamp = START + 5 * PERIOD
        (late,) = packet(made, 5, 2, received=50.35, own=stamp)
        assert late.faults == {"finger2": (Fault.LATE,)}
        jumped = START + 3600.0
        for k, number in enumerate((1, 2, 1, 2)):
            at = jumped + k * PERIOD
            (arrival,) = packet(made, 0, number, stamp=at, received=50.36 + k * PERIOD, own=at)
            faults = (Fault.CLOCK_JUMP,) if k == 0 else ()
            assert arrival.faults == ({f"finger{number}": faults} if faults else {})

    def test_times_increase(self):
        made = assembler(1, 2)
        times = []
        for k in range(5):
            made.stamp(START + k * PERIOD, 50.0 + k * PERIOD)
            made.add(1, readings(), START + k * PERIOD)
            made.add(2, readings(), START + k * PERIOD - 0.3)
            times += [arrival.time for arrival in made.finish(50.0 + k * PERIOD)]
        assert len(times) == 10
        assert (np.diff(times) > 0).all()


class TestCounters:
    @pytest.mark.parametrize(
        ("last", "sequence", "n"),
        [(0, 1, 0), (0, 5, 4), (7, 7, 0), (2**32 - 2, 1, 2), (5000, 0, 0), (0, 2**16, 0)],
    )
    def test_missing_packets(self, last, sequence, n):
        assert n_missing(last, sequence) == n

    def test_repeated_samples(self):
        made = assembler(1, 2)
        given = [(1, 5.0), (1, 5.0), (2, 5.0), (1, None), (1, 5.0), (1, 6.0)]
        new = [made.is_new(number, identity) for number, identity in given]
        assert new == [True, False, True, True, False, True]


class TestNotices:
    def test_each_topic_gives_one_notice_a_second(self):
        made = assembler(1)
        shown = []
        for k in range(25):
            made.notify("a", f"a {k}", 0.1 * k)
            made.notify("b", f"b {k}", 0.1 * k)
            shown += [notice for arrival in made.finish(0.1 * k) for notice in arrival.notices]
        assert shown == ["a 0", "b 0", "a 10", "b 10", "a 20", "b 20"]

    @pytest.mark.parametrize(("hold", "n_arrivals"), [(False, 25), (True, 3)])
    def test_refused_packets(self, hold, n_arrivals):
        made = assembler(1, hold_refusals=hold)
        arrivals = []
        for k in range(25):
            made.refuse("packet", "invalid", 0.1 * k)
            arrivals += made.finish(0.1 * k)
        assert len(arrivals) == n_arrivals
        assert all(math.isnan(arrival.time) for arrival in arrivals)
        (sample,) = packet(made, 0, 1)
        assert sum(arrival.n_refused for arrival in (*arrivals, sample)) == 25
