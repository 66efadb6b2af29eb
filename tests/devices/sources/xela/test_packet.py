import json

import numpy as np
import pytest

from holdfast.devices.sources.xela.packet import InvalidPacket, read_packet, read_sensor

from .build import NEW, OLD, WELCOME, sensor, text


def readings(part, *, calibrated=False):
    raw = json.dumps(part)
    packet = read_packet(text(1, {})[:-1] + f', "1": {raw}}}')
    return read_sensor(packet.sensors[1], calibrated=calibrated).readings()


def test_real_packets_contain_the_same_counts_twice(real_packets):
    assert len(real_packets) == 7
    for whole in real_packets.values():
        fields = json.loads(whole)
        packet = read_packet(whole)
        assert (packet.counter, packet.time) == (fields["message"], fields["time"])
        assert packet.version == fields["version"]
        assert sorted(packet.sensors) == list(range(1, fields["sensors"] + 1))
        for number, raw in packet.sensors.items():
            one = fields[str(number)]
            part = read_sensor(raw, calibrated=False)
            assert (part.model, part.taxels, part.time) == (
                one["model"],
                one["taxels"],
                one["time"],
            )
            assert part.readings().ravel().tolist() == one["integer"]
            assert part.readings().dtype == np.uint16
            newtons = read_sensor(raw, calibrated=True).readings()
            if "calibrated" in one:
                assert newtons.ravel().tolist() == one["calibrated"]
            else:
                assert newtons is None


@pytest.mark.parametrize("kind", [str, str.encode], ids=["text", "bytes"])
@pytest.mark.parametrize(
    ("given", "counter", "version", "expected"),
    [
        (OLD, 786, "", [[0xFA00, 0xFB00, 0xFC00]]),
        (NEW, 10416, "1.8.0b_200801", [[32845, 33398, 36714]]),
    ],
)
def test_both_versions(kind, given, counter, version, expected):
    packet = read_packet(kind(given))
    assert (packet.counter, packet.version) == (counter, version)
    assert packet.time == json.loads(given)["time"]
    (part,) = [read_sensor(raw, calibrated=False) for raw in packet.sensors.values()]
    assert part.readings().tolist() == expected
    assert part.time == (1769494922.614261 if version else None)
    assert read_sensor(packet.sensors[1], calibrated=True).readings() is None


@pytest.mark.parametrize(
    "given",
    [
        WELCOME,
        '{"message": "error", "data": []}',
        '{"message": true, "1": {}}',
        '{"message": 1.5, "1": {}}',
        "{}",
        '{"message": 7, "time": 1.0, "type": "calibration"}',
    ],
)
def test_packets_without_samples(given):
    assert read_packet(given) is None


def test_sensors_are_the_keys_that_are_numbers():
    given = {"message": 1, "time": 2.0, "10": {}, "2": {}, "1": {}, "²": {}, "x": 1, "-3": {}}
    assert list(read_packet(json.dumps(given)).sensors) == [1, 2, 10]


def test_what_is_not_finite_is_missing():
    given = (
        '{"message": 1, "time": 2.0, "1": {"calibrated": [NaN, 0, -Infinity, 1.5, null, -2], '
        '"temp": [NaN]}}'
    )
    part = read_sensor(read_packet(given).sensors[1], calibrated=True)
    np.testing.assert_array_equal(part.readings(), [[np.nan, 0.0, np.nan], [1.5, np.nan, -2.0]])
    assert part.readings().dtype == np.float64


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ("", "truncated"),
        (NEW[:300], "truncated"),
        ("[1, 2]", "array"),
        *((f'{{"message": {n}, "time": 1.0}}', "counter") for n in ("4294967296", "-1")),
        ('{"message": 1}', "time"),
        *((f'{{"message": 1, "time": {t}}}', "time") for t in ("NaN", "true", '"now"', "1e300")),
        ('{"message": 1, "time": 1e999}', "out of range"),
        ('{"message": ' + "[" * 100_000 + "]" * 100_000 + "}", "recursion"),
        (b'{"message": "\xff"}', "utf-8"),
        ("\ud800", "surrogate"),
    ],
)
def test_invalid_packets(given, why):
    with pytest.raises(InvalidPacket, match=f"(?i).*{why}") as refusal:
        read_packet(given)
    assert len(str(refusal.value)) <= 160


NO_DATA = (
    *("FA00,FB00,FC0", "FA00,FB00,FC00,", "FA00;FB00,FC00", "FA00,FB00,FCG0", "FA00,FB00,  00"),
    *("FA00,F,00,FC00", "FA00,F\t00,FC00", "FA00,FB00,FC0é"),
    *(f"{x}A00,FB00,FC00" for x in "+-/:@G`g\x7f ,"),
)


@pytest.mark.parametrize(
    ("part", "why"),
    [
        *(({"data": data}, "hexadecimal") for data in NO_DATA),
        ({"data": "FA00,FB00"}, "2 values"),
        ({"data": 7}, "data"),
        ({"integer": [1, 2, 65536]}, "uint16"),
        ({"integer": [1, 2, -1]}, "uint16"),
        ({"integer": [1, 2, 10**40]}, "integer"),
        ({"integer": [1, 2, 0.5]}, "float"),
        ({"integer": [1, 2]}, "2 values"),
        ({"data": "0001,0002,0003", "integer": [1, 2, 4]}, "differ"),
        ({"data": "0001,0002,0003", "integer": [1, 2, 3, 4]}, "differ"),
        ({"taxels": "1"}, "taxels"),
        ({"model": 5}, "model"),
        ({"model": "x" * 65}, "64"),
        ({"time": "now"}, "time"),
        ({"time": 1e300}, "time"),
        ([], "array"),
        ({"calibrated": [1.0, 2.0]}, "2 values"),
        ({"calibrated": "none"}, "calibrated"),
        ({"calibrated": [1.0, "2", 3.0]}, "calibrated"),
    ],
)
def test_invalid_sensors(part, why):
    with pytest.raises(InvalidPacket, match=why):
        readings(part, calibrated="calibrated" in part)


def test_newtons_do_not_need_valid_counts():
    part = sensor([[1, 2, 3]], data="?", integer=["?"], calibrated=[1.0, 2, -3.5])
    assert readings(part, calibrated=True).tolist() == [[1.0, 2.0, -3.5]]
    assert readings(sensor([[1, 2, 3]], calibrated="?")).tolist() == [[1, 2, 3]]
