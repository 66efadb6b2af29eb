import numpy as np
import pytest

from holdfast.contact import Fault
from holdfast.errors import SourceError
from holdfast.sensors import hand, sensor
from holdfast_ros.sensor_messages import DeviceSample
from holdfast_ros.sources.message_assembler import MessageAssembler

EPOCH = 1_619_157_045.0


def uskin(k, number=1, model="uSPa44", n_taxels=16, time=None, forces=0, **given):
    """Packet k of a sensor at 100 Hz."""
    fields = {
        "number": number,
        "model": model,
        "time": EPOCH + 0.01 * k if time is None else time,
        "stamp": None,
        "sequence": k,
        "counts": np.full((n_taxels, 3), k, np.uint16),
        "forces": np.full((forces, 3), 0.5 * k),
    }
    return DeviceSample(**(fields | given))


def pillars(k, n_taxels=9):
    forces = np.full((n_taxels, 3), 0.5 * k)
    return DeviceSample(None, "papillarray", 0.001 * k, EPOCH, None, None, forces)


def identified(*first, **given):
    assembler = MessageAssembler(**given)
    assembler.identify(first)
    return assembler


def taken(assembler, packets, start=50.0):
    """All arrivals of packets that come every 10 ms."""
    return [a for k, p in enumerate(packets) for a in assembler.assemble(p, start + 0.01 * k)]


class TestModules:
    def test_separate_sensors(self):
        first = uskin(0), uskin(0, 4, "uSCuAH", 30)
        assembler = identified(*first, names={4: "thumb"})
        assert assembler.sensors == {
            "finger1": sensor("uskin-4x4"),
            "thumb": sensor("uskin-curved"),
        }
        assert assembler.metadata == {"models": {"1": "uSPa44", "4": "uSCuAH"}}
        (arrival,) = assembler.assemble(first, 50.0)
        assert {name: s.shape for name, s in arrival.samples.items()} == {
            "finger1": (16, 3),
            "thumb": (30, 3),
        }

    def test_a_whole_hand(self):
        flat = np.arange(368 * 3, dtype=np.uint16).reshape(368, 3)
        message = uskin(0, 1, "XR23AHRCPP", counts=flat)
        assembler = identified(message)
        allegro = hand("allegro-uskin")
        assert list(assembler.sensors) == list(allegro.modules)
        assert assembler.metadata["hand"] == "allegro-uskin"
        (arrival,) = assembler.assemble([message], 50.0)
        for name, want in allegro.split(flat).items():
            np.testing.assert_array_equal(arrival.samples[name], want)

    def test_newtons(self):
        first = uskin(3, forces=16)
        assembler = identified(first, unit="N")
        (module,) = assembler.sensors.values()
        assert (module.unit, module.range) == ("N", None)
        (arrival,) = assembler.assemble([first], 50.0)
        np.testing.assert_array_equal(arrival.samples["finger1"], np.full((16, 3), 1.5))

    @pytest.mark.parametrize("unit", ["count", "N"])
    def test_pillars_have_newtons_only(self, unit):
        assembler = identified(pillars(0), names={1: "tip"}, unit=unit)
        assert assembler.sensors == {"tip": sensor("papillarray")}
        (arrival,) = assembler.assemble([pillars(2)], 50.0)
        assert arrival.time == 0.002
        np.testing.assert_array_equal(arrival.samples["tip"], np.ones((9, 3)))

    @pytest.mark.parametrize(
        ("message", "given", "text"),
        [
            (uskin(0), {"unit": "N"}, "sensor 1"),
            (uskin(0, n_taxels=24), {}, "24 taxels"),
            (pillars(0, 4), {}, "4 taxels"),
            (pillars(0), {"names": {2: "a"}}, "fingers= names 2"),
            (uskin(0), {"names": {2: "a"}}, "fingers= names 2"),
        ],
    )
    def test_devices_that_do_not_fit(self, message, given, text):
        with pytest.raises(SourceError, match=text):
            identified(message, **given)


class TestTimes:
    @pytest.mark.parametrize(
        ("time", "stamp", "start"),
        [(EPOCH, 7.0, EPOCH), (1e300, None, 50.0), (None, 7.0, 7.0), (None, None, 50.0)],
        ids=["device", "thousands of years away", "header", "host"],
    )
    def test_the_best_stamp_counts(self, time, stamp, start):
        def later(first, k):
            return None if first is None else first + 0.01 * k

        packets = [[uskin(k, time=0, stamp=later(stamp, k))] for k in range(5)]
        packets = [[one._replace(time=later(time, k))] for k, (one,) in enumerate(packets)]
        arrivals = taken(identified(*packets[0]), packets)
        found = [a.time - start for a in arrivals]
        np.testing.assert_allclose(found, 0.01 * np.arange(5), atol=1e-6)
        assert [int(a.samples["finger1"][0, 0]) for a in arrivals] == list(range(5))

    @pytest.mark.parametrize("wrong", [1e300, -1e300, 1e12, np.nan])
    def test_a_stamp_that_is_thousands_of_years_away_is_refused(self, wrong):
        packets = [[uskin(k)] for k in range(10)]
        packets[4] = [uskin(4, time=wrong)]
        arrivals = taken(identified(*packets[0]), packets)
        assert [a.n_refused for a in arrivals] == [0] * 4 + [1] + [0] * 5
        times = [a.time - EPOCH for a in arrivals if a.samples]
        np.testing.assert_allclose(times, [0.01 * k for k in range(10) if k != 4], atol=1e-6)


class TestPackets:
    def test_repeated_packets_are_no_samples_but_a_new_stamp_is(self):
        packets = [[uskin(k // 2)] for k in range(6)]
        assert len(taken(identified(*packets[0]), packets)) == 3
        packets = [[uskin(k, sequence=0, counts=np.zeros((16, 3), np.uint16))] for k in range(3)]
        assert len(taken(identified(*packets[0]), packets)) == 3

    def test_missing_packets_are_counted_unless_the_publisher_is_another(self):
        assembler = identified(uskin(0), uskin(0, 2))
        packets = [[uskin(k, sequence=n), uskin(k, 2, sequence=n)] for k, n in ((0, 0), (1, 3))]
        assert [a.n_lost for a in taken(assembler, packets)] == [0, 2]
        assembler.reconnected()
        (arrival,) = assembler.assemble([uskin(2, sequence=90)], 50.02)
        assert arrival.n_lost == 0


@pytest.mark.parametrize(
    ("unit", "later"),
    [("count", uskin(1, n_taxels=24)), ("count", uskin(1, n_taxels=0)), ("N", uskin(1))],
    ids=["other taxels", "off", "forces that end"],
)
def test_a_device_that_changes_has_a_fault(unit, later):
    assembler = identified(uskin(0, forces=16), uskin(0, 2, forces=16), unit=unit)
    (arrival,) = assembler.assemble([later, uskin(1, 2, forces=16)], 50.0)
    assert set(arrival.samples) == {"finger2"}
    assert arrival.faults == {"finger1": (Fault.TAXEL_COUNT,)}
